"""One world as files that any MuJoCo opens (host)."""

import importlib.metadata
import json
import os
import pathlib
from typing import Any, Literal
from xml.etree import ElementTree

import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import __version__
from mjx_arenas.build import mjcf
from mjx_arenas.files.output import whole
from mjx_arenas.params.params import ArenaParams, named, on_host
from mjx_arenas.problem import problem
from mjx_arenas.record.record import Record
from mjx_arenas.rules import validation
from mjx_arenas.twin import twin


def add_state(spec: mujoco.MjSpec, c: mujoco.MjData) -> None:
    """Adds the keyframe "state", which holds the state of a world."""
    values = {name: np.array(getattr(c, name)) for name in ("qpos", "qvel", "act", "ctrl")}
    mocap = {"mpos": c.mocap_pos.reshape(-1), "mquat": c.mocap_quat.reshape(-1)}
    spec.add_key(name="state", time=c.time, **values, **mocap)


def export(
    record: Record,
    params: ArenaParams,
    folder: str | os.PathLike,
    data: mjx.Data | mujoco.MjData | None,
    format: Literal["xml", "mjb"],
    seed: int | None,
    world: int | None,
    keyframe: str | None,
) -> None:
    """Writes one world of an arena to a folder; see `Arena.export`."""
    noted = {"seed": seed, "world": world}
    must = "None or a whole number >= 0"
    noted |= {n: validation.whole(n, number, 0, must=must) for n, number in noted.items() if number is not None}
    if format not in ("xml", "mjb"):
        raise validation.error([problem("format", "must", None, format, must="'xml' or 'mjb'")])
    spec, model = twin.world_spec(record, params)
    if data is not None or keyframe is not None or record.scene.starting:
        add_state(spec, twin.c_world(record, params, data, keyframe=keyframe)[1])
        model = spec.compile()
    about = {**noted, "tables": record.table_names, "objects": [*record.object_names]}
    written = mjcf.proven(spec, model, "params") if format == "xml" else model
    write(folder, written, dict(spec.assets), params, about)


def write(
    folder: str | os.PathLike,
    world: mujoco.MjModel | str | None,
    assets: dict[str, bytes],
    params: ArenaParams,
    about: dict[str, Any],
) -> None:
    """Writes a folder with a world and what it needs, whole or not at all.

    Args:
        folder: that does not exist, or is empty.
        world: as MJCF, or compiled; None: no such file.
        assets: files that the MJCF's specs hold themselves, by name.
        params: of the world.
        about: what else is known of it.
    """
    validation.check_path("folder", folder)
    files = with_copies(world, assets) if isinstance(world, str) else {}
    with whole(pathlib.Path(folder)) as unfinished:
        unfinished.mkdir()
        for name, content in files.items():
            (unfinished / name).parent.mkdir(parents=True, exist_ok=True)
            (unfinished / name).write_bytes(content)
        if isinstance(world, mujoco.MjModel):
            mujoco.mj_saveModel(world, str(unfinished / "world.mjb"))
        values = {name: value.tolist() for name, value in named(on_host(params)).items()}
        terms = {name: values.pop(name) for name in params.terms}
        versions = {name: importlib.metadata.version(name) for name in ("mujoco", "mujoco-mjx", "jax")}
        note = {
            **about,
            "params": values,
            **({"terms": terms} if terms else {}),
            "versions": {"mjx_arenas": __version__, **versions},
        }
        (unfinished / "params.json").write_text(json.dumps(note, indent=2) + "\n", encoding="utf-8")


def with_copies(xml: str, assets: dict[str, bytes], name: str = "world.xml") -> dict[str, bytes]:
    """MJCF under a name, and every file that it names under `assets`, by their paths in the folder.

    Raises:
        OSError: one sentence, if a file cannot be read.
    """
    root = ElementTree.fromstring(xml)
    folders = [""]  # in which MuJoCo looks for assets
    for compiler in root.iter("compiler"):
        folders += [
            compiler.attrib.pop(name) for name in ("meshdir", "texturedir", "assetdir") if name in compiler.attrib
        ]
    copies: dict[str, str] = {}
    contents: dict[str, bytes] = {}
    for element in root.iter():  # skins stand outside <asset>
        for attribute in [n for n in element.attrib if n.startswith("file")]:
            source = element.attrib[attribute]
            if source not in copies:
                copies[source] = _free_name(os.path.basename(source), copies.values())
                held = next((path for f in folders if (path := os.path.join(f, source)) in assets), None)
                contents[copies[source]] = _read(source) if held is None else assets[held]
            element.set(attribute, copies[source])
    ElementTree.indent(root)
    return {name: (ElementTree.tostring(root, encoding="unicode") + "\n").encode(), **contents}


def _read(file: str) -> bytes:
    try:
        return pathlib.Path(file).read_bytes()
    except OSError as error:
        raise type(error)(f"Cannot read {file!r}, which the arena needs: {error.strerror}.") from None


def _free_name(name: str, taken: Any) -> str:
    """A path of its own for each file, which keeps its name: meshes are called by it."""
    folders = ("assets", *(f"assets/{i}" for i in range(1, len(taken) + 1)))
    return next(path for path in (f"{folder}/{name}" for folder in folders) if path not in taken)
