"""What decides a training: a file for each task, what a user's own says instead, and what the command line says (host).

A configuration is plain data, nested by names. Files may have two parts that lie over the rest: `cpu`, where there is no GPU, and `pixels`,
for policies that see pictures.
"""

import copy
import hashlib
import math
import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mjx_arenas.keywords import nearest

if TYPE_CHECKING:
    from mjx_arenas.problem import Problem

FOLDER = pathlib.Path(__file__).parent / "trainings"
COMMON = "common"  # of all tasks
ARENAS = ("every_episode", "fixed", "nominal")
_OVERLAYS = ("pixels", "cpu")
_OPEN = ("env", "ranges", "wider_ranges", "ppo", "dagger", "network_factory")
"""Parts in which a user may name what the task's own file does not."""
_LIMITS: Mapping[str, tuple[float, float, bool]] = {
    "learning_rate": (0.0, math.inf, False),
    "discounting": (0.0, 1.0, True),
    "gae_lambda": (0.0, 1.0, True),
    "clipping_epsilon": (0.0, math.inf, False),
    "entropy_cost": (0.0, math.inf, True),
    "max_grad_norm": (0.0, math.inf, False),
    "reward_scaling": (0.0, math.inf, False),
    "normalize_observations_std_eps": (0.0, math.inf, True),
    "num_timesteps": (1, math.inf, True),
    "num_envs": (1, math.inf, True),
    "num_minibatches": (1, math.inf, True),
    "num_evals": (1, math.inf, True),
    "num_eval_envs": (1, math.inf, True),
    "num_resets_per_eval": (0, math.inf, True),
    "demo_length": (1, math.inf, True),
    "unroll_length": (1, math.inf, True),
    "num_updates_per_batch": (1, math.inf, True),
    "batch_size": (1, math.inf, True),
    "max_devices_per_host": (1, math.inf, True),
    "epochs": (1, math.inf, True),
}
"""The least and the most of a trainer's numbers, and whether the least is allowed; where it is an integer, they are whole."""
_NAMES = (*_OPEN, "env.config", "env.terms")
"""Parts that have names and values, also where the library has none."""
_ABOVE = {"arenas": "--arenas", "impl": "--engine"}
"""Keys of an environment's configuration that the training has itself, and their options on the command line."""
DIGEST = "arena_sha256"
"""The key of a configuration for the digest of its arena's file; trainings before 2026-11-29 have none."""
MADE = "made"
"""The key of a configuration for what a task of a user's own makes, whose code may change; trainings before 2026-11-30 have none."""
_TOP = ("task", "env", "ranges", "wider_ranges", "arenas", "impl", "seed", "stages", "eval_worlds", "ppo", "dagger")


def tasks() -> list[str]:
    """Names of the tasks."""
    return sorted(file.stem for file in FOLDER.glob("*.yaml") if file.stem != COMMON)


def is_own(task: Any) -> bool:
    """Whether a task, or an arm, is a user's own, which is imported: "module:function"."""
    return isinstance(task, str) and ":" in task


def find(name: str) -> pathlib.Path | str:
    """The file of a task by its name, or one of a user's own; of a task that is imported the name itself.

    Raises:
        ValueError, FileNotFoundError: there is none.
    """
    file = pathlib.Path(name)
    if name in tasks():
        return FOLDER / f"{name}.yaml"
    if file.suffix not in (".yaml", ".yml", ".json"):
        if is_own(name):
            return name
        known, close = ", ".join(tasks()), nearest(name, tasks())
        raise _refused("task", "no_task_meant" if close else "no_task", name, known=known, close=close)
    if not file.is_file():
        beside = {one.stem: str(one) for one in sorted(file.parent.glob(f"*{file.suffix}"))}
        close = nearest(file.stem, beside)
        raise FileNotFoundError(f"There is no file {name!r}." + (f" Did you mean {beside[close]}?" if close else ""))
    return file


def read(file: pathlib.Path | str) -> dict[str, Any]:
    """What a file says of a training: a task's own what differs from all others, one of a user's own what differs from that of its `task`.

    A task that is imported has no file, and what is common to all.

    Raises:
        ValueError: what is wrong with it.
        ImportError: YAML needs `ruamel.yaml`.
    """
    if isinstance(file, str):
        return merged(_parsed(FOLDER / f"{COMMON}.yaml"), {"task": file}, file)
    own = _parsed(file)
    if own.get("task") not in tasks() and not is_own(own.get("task")):
        known = ", ".join(tasks())
        raise _refused("task", "task_of_file", own.get("task"), file=file, known=known)
    if file.parent == FOLDER:
        return merged(_parsed(FOLDER / f"{COMMON}.yaml"), own, str(file))
    env = own.get("env")
    if isinstance(env, dict) and isinstance(env.get("arena"), str) and (file.parent / env["arena"]).is_file():
        own["env"] = env | {
            "arena": str((file.parent / env["arena"]).resolve())
        }  # relative to the file, as in files of arenas
    below = read(own["task"] if is_own(own["task"]) else find(own["task"]))
    pixels = below["pixels"]
    under = {"cpu": _with(below["cpu"], own), "pixels": {**pixels, "cpu": _with(pixels["cpu"], own.get("pixels"))}}
    return merged({**below, **under}, own, str(file))


def _with(library: Mapping[str, Any], own: Any) -> dict[str, Any]:
    """What the library says of machines without a GPU, with what a user's file says of all machines in its place."""
    if not isinstance(own, Mapping):
        return dict(library)
    return {n: _with(x, own.get(n)) if isinstance(x, Mapping) else own.get(n, x) for n, x in library.items()}


def merged(below: Mapping[str, Any], above: Mapping[str, Any], source: str) -> dict[str, Any]:
    """The numbers of one configuration over those of another.

    Raises:
        ValueError: a name or a value makes no sense there; the sentence begins with the `source`.
    """
    return _merged(below, above, source, ())


def _merged(below: Mapping[str, Any], above: Mapping[str, Any], source: str, at: tuple[str, ...]) -> dict[str, Any]:
    found: dict[str, Any] = copy.deepcopy(dict(below))
    inside = [name for name in at if name not in _OVERLAYS]
    for name, value in above.items():
        path = ".".join((*at, str(name)))
        known = {*below, *(() if inside else (*_TOP, *_OVERLAYS))}
        if name not in known and not {*inside} & {*_OPEN}:
            inner = (f"{a}.{b}" for a, own in below.items() if isinstance(own, Mapping) for b in own if b == name)
            close = next(inner, None) or nearest(str(name), sorted(known))
            told = {"file": source, "known": ", ".join(sorted(known)), "close": close and ".".join((*at, close))}
            raise _refused(path, "setting_meant" if close else "setting_unknown", value, **told)
        if name in ("ranges", "wider_ranges") or not isinstance(value, Mapping):
            names = isinstance(below.get(name), Mapping) or (
                ".".join((*inside, str(name))) in _NAMES and value is not None
            )
            if names and not isinstance(value, Mapping):
                raise _refused(path, "setting_names", value, file=source)
            _check(source, path, below.get(name), value)
            found[name] = copy.deepcopy(value)
        else:
            part = {} if found.get(name) is None else found[name]
            if not isinstance(part, Mapping):
                raise _refused(path, "setting_like", value, file=source, wanted=part)
            found[name] = _merged(part, value, source, (*at, str(name)))
    return found


def _check(source: str, path: str, before: Any, value: Any) -> None:
    """Refuses a value of another kind than the one before it."""
    if before is None:
        return
    kinds = (int, float) if type(before) is float else (list, tuple) if type(before) is list else (type(before),)
    if type(value) not in kinds:
        raise _refused(path, "setting_like", value, file=source, wanted=before)


def _problem(path: str, rule: str, got: Any, **numbers: Any) -> "Problem":
    from mjx_arenas.problem import Problem  # which imports NumPy

    return Problem(path, rule, None, got, numbers)


def _refused(path: str, rule: str, got: Any = None, **numbers: Any) -> Exception:
    from mjx_arenas.problems.messages import error  # which imports MuJoCo

    return error([_problem(path, rule, got, **numbers)])


def given(dotted: str, value: Any, source: str = "") -> dict[str, Any]:
    """A configuration of one value by its dotted name.

    Raises:
        ValueError: it is in a part that files alone have; the sentence begins with the `source`.
    """
    part, _, inner = dotted.partition(".")
    if part in _OVERLAYS:
        raise _refused(dotted, "setting_of_files", value, file=source, instead=f"`{inner or 'ppo.num_envs'}`")
    for name in reversed(dotted.split(".")):
        value = {name: value}
    return value


def settled(data: Mapping[str, Any], gpu: bool, pixels: bool) -> dict[str, Any]:
    """The configuration for a machine with or without a GPU, and for policies that see numbers or pictures."""
    found = {name: x for name, x in data.items() if name not in _OVERLAYS}
    layers = [data, data.get("pixels", {})] if pixels else [data]
    for layer in layers[1:]:
        found = merged(found, {name: x for name, x in layer.items() if name not in _OVERLAYS}, "pixels")
    for layer in () if gpu else layers:
        found = merged(found, layer.get("cpu", {}), "cpu")
    return found


def sees_pictures(config: Mapping[str, Any]) -> bool:
    """Whether the policy of a configuration sees pictures."""
    return config.get("sees") == "pictures"


def part(config: Mapping[str, Any]) -> str:
    """The part of a configuration that its trainer's numbers are in: PPO's, or DAgger's of a policy that sees pictures."""
    return "dagger" if sees_pictures(config) else "ppo"


def learner(config: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of the trainer of a configuration."""
    return config[part(config)]


def configuration(data: Mapping[str, Any], impl: str, pixels: bool) -> dict[str, Any]:
    """What decides a training, as its folder keeps it; of a policy that sees with its teacher's."""
    config = {
        "ranges": None,
        "wider_ranges": None,
        "env": {},
        **data,
        "impl": data.get("impl") or impl,
        "sees": "numbers",
    }
    arena = (config["env"] or {}).get("arena")
    if isinstance(arena, str) and pathlib.Path(arena).is_file():
        config[DIGEST] = digest(arena)
    if not pixels:
        config.pop("dagger", None)
        return config
    teacher = config | {"sees": "everything", "arenas": "every_episode", "stages": 1}
    teacher.pop("dagger")
    if own := (config["env"] or {}).get("config"):
        teacher["env"] = config["env"] | {"config": {name: x for name, x in own.items() if name != "num_arenas"}}
    config.pop("ppo")
    return config | {"sees": "pictures", "teacher": teacher}


def digest(file: pathlib.Path | str) -> str:
    """What tells the text of an arena's file from others."""
    return hashlib.sha256(pathlib.Path(file).read_bytes()).hexdigest()[:16]


def problem(config: Mapping[str, Any], devices: int) -> "Problem | None":
    """What makes no sense in a configuration."""
    for name in ("stages", "eval_worlds"):
        if config[name] < 1:
            return _must(name, "at least 1", config[name])
    if not 0 <= config.get("seed", 0) < 2**32:
        return _must("seed", "a whole number from 0 to 2^32 - 1", config["seed"])
    values = flat(config)
    for name, option in _ABOVE.items():
        if (path := f"env.config.{name}") in values:
            return _problem(path, "setting_above", values[path], above=name, option=option)
    if config["arenas"] not in ARENAS:
        return _must("arenas", f"one of {', '.join(ARENAS)}", config["arenas"])
    if sees_pictures(config) and devices > 1:
        return _problem("sees", "one_device_for_pictures", devices)
    numbers = learner(config)
    wrong = _number_problem(part(config), numbers)
    wrong = wrong or (_dagger_problem(numbers) if sees_pictures(config) else _ppo_problem(numbers, devices))
    return wrong or (problem(config["teacher"], devices) if "teacher" in config else None)


def _dagger_problem(numbers: Mapping[str, Any]) -> "Problem | None":
    """What DAgger's numbers do not make together."""
    if numbers["num_evals"] < 2:
        return _must("dagger.num_evals", "at least 2, as Brax's DAgger always begins with one", numbers["num_evals"])
    if (pictures := numbers["num_envs"] * numbers["demo_length"]) % numbers["num_minibatches"]:
        return _problem("dagger.num_envs", "pictures_of_minibatches", pictures, n=numbers["num_minibatches"])
    return None


def _ppo_problem(numbers: Mapping[str, Any], devices: int) -> "Problem | None":
    """What PPO's numbers do not make together, and what the devices cannot share equally: its worlds, and each of its minibatches."""
    samples = (numbers.get("batch_size") or 0) * numbers["num_minibatches"]
    if samples and samples % numbers["num_envs"]:
        return _problem("ppo.batch_size", "batches_of_worlds", samples, n=numbers["num_envs"])
    if not samples and numbers["num_envs"] % numbers["num_minibatches"]:
        return _problem("ppo.num_envs", "worlds_of_minibatches", numbers["num_envs"], n=numbers["num_minibatches"])
    devices = min(devices, numbers.get("max_devices_per_host") or devices)
    batch = numbers.get("batch_size") or 0  # 0: num_envs / num_minibatches
    times, n = ("", devices) if batch else ("`ppo.num_minibatches` times ", devices * numbers["num_minibatches"])
    for name, value in (("num_envs", numbers["num_envs"]), ("batch_size", batch)):
        if value % n:
            return _problem(f"ppo.{name}", "shared_by_devices", value, n=n, times=times)
    return None


def _must(path: str, must: str, got: Any) -> "Problem":
    return _problem(path, "must", got, must=must)


def _number_problem(part: str, numbers: Mapping[str, Any]) -> "Problem | None":
    """What no trainer can make anything of; what is not given, or None, is the trainer's own."""
    for name, (least, most, also) in _LIMITS.items():
        value = numbers.get(name)
        if value is None:
            continue
        whole = isinstance(least, int)
        right = isinstance(value, int if whole else (int, float)) and not isinstance(value, bool)
        if not right or not math.isfinite(value) or not (least < value <= most or (also and value == least)):
            kind, low = "a whole number" if whole else "a number", f"{'>=' if also else '>'} {least:g}"
            return _must(f"{part}.{name}", f"{kind} {low}{'' if math.isinf(most) else f' and <= {most:g}'}", value)
    for name, value in numbers.get("network_factory", {}).items():
        if name.endswith("_obs_key") and not isinstance(value, str):
            return _must(f"{part}.network_factory.{name}", "the name of an observation", value)
        sizes = value if isinstance(value, (list, tuple)) else ()
        if not all(isinstance(size, int) and not isinstance(size, bool) and size >= 1 for size in sizes):
            return _must(f"{part}.network_factory.{name}", "whole numbers >= 1", value)
    return None


def flat(config: Mapping[str, Any]) -> dict[str, Any]:
    """All values of a configuration by their dotted names."""
    found: dict[str, Any] = {}
    for name, value in config.items():
        if isinstance(value, Mapping) and value and name not in ("ranges", "wider_ranges"):
            found |= {f"{name}.{inner}": x for inner, x in flat(value).items()}
        else:
            found[name] = value
    return found


def _parsed(file: pathlib.Path) -> dict[str, Any]:
    from mjx_arenas.files import text  # which imports MuJoCo

    parsed = text.parse(text.read(file), file)
    if parsed.twice:
        at = parsed.twice[0]
        raise _refused(".".join(map(str, at)), "setting_twice", file=file, line=parsed.lines.get(at) or 1)
    if not isinstance(parsed.data, dict):
        raise _refused("", "training_names", parsed.data, file=file)
    return parsed.data
