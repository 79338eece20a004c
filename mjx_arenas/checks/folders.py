"""Worlds that fail as folders: bundles (host). K objects."""

import contextlib
import dataclasses
import functools
import json
import os
import pathlib
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from mjx_arenas.build import mjcf
from mjx_arenas.checks import causes, kept_rules, watch, watch_c
from mjx_arenas.checks.causes import CAUSES, Failure
from mjx_arenas.checks.engines import Run
from mjx_arenas.checks.watch_c import Rolled, State
from mjx_arenas.files import export
from mjx_arenas.files.output import whole
from mjx_arenas.params.params import QUANTITIES, ArenaParams, ArenaRanges, each, on_host
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation, validation_worlds
from mjx_arenas.sample import placement, poses, tops
from mjx_arenas.spec import specs
from mjx_arenas.twin import cpu, twin

VERSION = 2
STATES = ("start", "good")


def write(folder: str | os.PathLike, record: Record, ranges: ArenaRanges, run: Run, about: dict[str, Any]) -> None:
    """Writes a bundle, whole or not at all; one that is there is replaced.

    Args:
        folder: that does not exist, is empty or is a bundle.
        record: of the arena.
        ranges: that it was drawn from.
        run: of the world.
        about: what was found, and how.
    """
    validation.check_path("folder", folder)
    folder = pathlib.Path(folder)
    if folder.exists() and not is_bundle(folder) and not (folder.is_dir() and not any(folder.iterdir())):
        raise messages.error([problem("folder", "no_bundle_here", None, str(folder))], kind=FileExistsError)
    spec, c = _world(record, run)
    about = {
        "bundle": VERSION,
        **about,
        "compiles": c is not None,
        "rules": kept_rules.write(record, on_host(run.params), ranges),
    }
    places = record.layout.places
    about |= {"center": np.asarray(placement.body_centers(places, on_host(run.params))).tolist()}
    start, good = (run.start, run.good) if c is None or run.start else (watch_c.state(c),) * 2
    states: dict[str, Any] = {"objects": run.qpos}
    for of, state in zip(STATES, (start, good), strict=True):
        states |= {f"{of}_{name}": x for name, x in (state or {}).items()}
    names = {"tables": record.table_names, "objects": list(record.object_names)}
    noted = {"seed": about["seed"], "world": about["world"], **names}
    world = None if spec is None else _as_written(spec)
    with whole(folder, over=is_bundle) as unfinished:
        export.write(unfinished, world, dict(record.spec.assets), run.params, noted)
        np.savez_compressed(unfinished / "states.npz", **states)
        (unfinished / "failure.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def _as_written(spec: mujoco.MjSpec) -> str | mujoco.MjModel:
    """A world as MJCF; compiled, where MJCF would lose something of it."""
    model = spec.compile()
    try:
        return mjcf.proven(spec, model, "params")
    except ValueError:
        return model


def _world(record: Record, run: Run) -> tuple[mujoco.MjSpec, mujoco.MjData] | tuple[None, None]:
    """A world at its start, which is the keyframe "state"; None if MuJoCo does not compile it."""
    try:
        spec, model = twin.world_spec(record, run.params, checked=False)
    except ValueError:
        return None, None
    c = mujoco.MjData(model)
    for k in np.flatnonzero(tops.present(on_host(run.params), record.parts.places.ground)[1]).tolist():
        c.joint(record.parts.objects[k].joint).qpos = run.qpos[k]
    watch_c.set_state(c, run.start or {})
    with cpu.silent():
        mujoco.mj_forward(model, c)
    export.add_state(spec, c)
    return spec, c


def is_bundle(folder: pathlib.Path) -> bool:
    """Whether a folder looks like a bundle."""
    return (folder / "failure.json").is_file() and (folder / "states.npz").is_file()


@dataclasses.dataclass(frozen=True)
class Bundle:
    """A world that failed."""

    about: dict[str, Any]
    recorded: dict[str, Failure]
    params: ArenaParams
    tables: tuple[str, ...]
    objects: tuple[str, ...]
    qpos: np.ndarray  # (K, 7) of the objects at the start
    model: mujoco.MjModel | None  # None: MuJoCo does not compile it
    states: dict[str, State]  # by `STATES`; none without a model

    @classmethod
    def read(cls, folder: str | os.PathLike) -> "Bundle":
        """What `write` wrote; one sentence that names the file if it did not."""
        validation.check_path("bundle", folder)
        folder = pathlib.Path(folder)
        if not folder.is_dir():
            what = "is a file" if folder.exists() else "does not exist"
            raise messages.error([problem("bundle", "no_bundle", None, str(folder), what=what)], kind=FileNotFoundError)
        with _reading(folder / "failure.json"):
            about = _json(folder / "failure.json")
            if about["bundle"] != VERSION:
                raise ValueError(f"it is of version {about['bundle']}, this is for {VERSION}")
            recorded = {cause: _failure(about["causes"][cause]) for cause in CAUSES if cause in about["causes"]}
            if not recorded:
                raise ValueError("it has no cause of failure")
            for name in ("seed", "world", "n_steps", *(["room"] if about["room"] is not None else [])):
                validation.whole(name, about[name], 0)
            must = f"a whole number from 0 to {about['n_steps']}, the steps that were taken"
            steps = {"good_step": about["good_step"]} | {f"causes.{c}.step": f.step for c, f in recorded.items()}
            for name, step in steps.items():
                validation.whole(name, step, 0, about["n_steps"], must)
        with _reading(folder / "params.json"):
            world = _json(folder / "params.json")
            tables, objects = tuple(world["tables"]), tuple(world["objects"])
            count = {"table": len(tables), "object": len(objects)}
            shapes = {name: (count[rule.of], *rule.item) for name, rule in QUANTITIES.items()}
            terms = {name: np.asarray(value) for name, value in world.get("terms", {}).items()}
            own = (kept_rules.shaped(name, world["params"][name], shape) for name, shape in shapes.items())
            params = ArenaParams(*own, terms=terms)
            params = on_host(params)
        with _reading(folder / "failure.json"):
            about["of_terms"] = [str(one) for one in about["rules"].get("of_terms", ())]
            about["rules"] = kept_rules.read(about["rules"], tables, objects)
            about["center"] = kept_rules.shaped("center", about["center"], (len(objects), 3))
        ground = about["rules"].ground
        with _reading(folder / "params.json"):
            params = params._replace(terms={**params.terms, **kept_rules.of_parts(params.terms, about["rules"])})
            most = len(tables) + tops.count(ground) - 1
            if not np.isin(params.object_tables, range(most + 1)).all():
                raise messages.error([problem("object_tables", "table_number", None, params.object_tables, most=most)])
            there = tops.present(params, ground)[1]
        model = _model(folder, [objects[k] for k in np.flatnonzero(there)]) if about["compiles"] else None
        file = folder / "states.npz"
        with _reading(file), file.open("rb") as opened, np.load(opened) as arrays:
            qpos = kept_rules.shaped("objects", arrays["objects"], (len(objects), 7))
            states = {of: _state(arrays, of, model) for of in STATES} if model else {}
        return cls(about, recorded, params, tables, objects, qpos, model, states)

    @property
    def cause(self) -> str:
        """The worst of what was recorded."""
        return next(iter(self.recorded))

    @property
    def parts(self) -> list[str]:
        """Names of the parts of furniture."""
        return [part.name for part in self.about["rules"].furniture]

    @functools.cached_property
    def tops(self) -> watch.Tops:
        """The surfaces (1, ...) to which the objects of the world belong."""
        params = each(lambda value: np.asarray(value)[None], self.params)
        return watch.tops(params, self.about["center"], self.about["rules"].ground)

    def data(self, of: str) -> mujoco.MjData:
        """The world in one of its states."""
        assert self.model is not None
        c = mujoco.MjData(self.model)
        watch_c.set_state(c, self.states[of])
        return c

    def first_step(self, of: str) -> int:
        """The step after which it was in that state."""
        return 0 if of == "start" else self.about["good_step"]

    def roll(self, of: str) -> Rolled:
        """The rollout from one of the states to the last step."""
        n_steps = self.about["n_steps"] - self.first_step(of)
        return watch_c.roll(lambda _: self.data(of), self.tops, self.objects, n_steps)

    def at_the_start(self) -> dict[str, Failure]:
        """What is wrong before any step: by the parameters, and by where the objects were put."""
        above = -watch.out_of_place(self.tops, self.qpos[None, :, :3], self.qpos[None, :, 3:])[1][0]
        rules = self.about["rules"]
        half = np.asarray(poses.sizes(rules.poses, rules.variants, self.params))[:, 2] / 2
        found = causes.placement(self.objects, ~self.tops.there[0] | (above < half + placement.LIFTED))
        problems = list(map(messages.sentence, validation_worlds.world_problems(self.params, self.about["rules"])))
        problems += [one for one in self.about["of_terms"] if one not in problems]
        return found | ({"invalid_arena": causes.invalid(problems)} if problems else {})


@contextlib.contextmanager
def _reading(file: pathlib.Path) -> Iterator[None]:
    """Answers a damaged file with one sentence that names it."""
    if not file.is_file():
        within = sorted(one.parent.name for one in file.parent.glob(f"*/{file.name}"))
        inside = f"; {within[0]!r} in it may be one" if within else ""
        given = {"file": file.name, "inside": inside}
        raise messages.error([problem("bundle", "bundle_lacks", None, str(file.parent), given)], kind=FileNotFoundError)
    try:
        yield
    except zipfile.BadZipFile:
        raise _damaged(file, "it is no .npz file") from None
    except KeyError as error:
        raise _damaged(
            file, f"{str(error.args[0]).removesuffix(' is not a file in the archive')!r} is missing"
        ) from None
    except UnicodeDecodeError:
        raise _damaged(file, "it is no text in UTF-8") from None
    except json.JSONDecodeError as error:
        raise _damaged(file, f"it is no JSON in line {error.lineno}") from None
    except (TypeError, AttributeError, IndexError):
        raise _damaged(file, "its values are of other kinds") from None
    except (ValueError, OSError, EOFError, zlib.error) as error:
        why = "it is no .npz file" if "pickle" in str(error) else " ".join(str(error).split())
        raise _damaged(file, why, messages.problems_of(error)[0].path or "bundle") from None


def _damaged(file: pathlib.Path, why: str, path: str = "bundle") -> Exception:
    """The error that says what is wrong with a file, and with what in it."""
    return messages.error([problem(path, "damaged", None, None, file=str(file), why=why.rstrip("."))])


def _json(file: pathlib.Path) -> dict[str, Any]:
    data = json.loads(file.read_text(encoding="utf-8"))
    if not isinstance(data, dict):
        raise ValueError(f"it holds a {type(data).__name__}, not names and values")
    return data


def _failure(data: dict[str, Any]) -> Failure:
    return Failure(int(data["world"]), data["step"], float(data["number"]), str(data["what"]))


def _model(folder: pathlib.Path, objects: Sequence[str]) -> mujoco.MjModel:
    """The model of a world in which these objects are there."""
    compiled = (folder / "world.mjb").is_file()
    file = folder / ("world.mjb" if compiled else "world.xml")
    with _reading(file):
        try:
            model = (mujoco.MjModel.from_binary_path if compiled else mujoco.MjModel.from_xml_path)(str(file))
        except ValueError as error:
            raise ValueError(f"MuJoCo cannot read it: {specs.one_line(error)}") from None
        free = {model.body(b).name for b in model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]}
        missing = [name for name in objects if name not in free]
        if missing:
            raise ValueError(f"it is of another world, without the object {missing[0]!r}")
    return model


def _state(arrays: Mapping[str, np.ndarray], of: str, model: mujoco.MjModel) -> State:
    c, state = mujoco.MjData(model), {name: np.asarray(arrays[f"{of}_{name}"], float) for name in cpu.STATE}
    for name, value in state.items():
        want = np.shape(getattr(c, name))
        if value.shape != want:
            raise ValueError(f"`{of}_{name}` has shape {value.shape}, in world.xml it is {want}")
    return state
