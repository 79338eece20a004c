"""MJCF of an arena and of its worlds, in full precision, and whether it gives back the same model (host)."""

import contextlib
import ctypes
import functools
import pathlib
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from mjx_arenas.build import order
from mjx_arenas.primitives import SIZES
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import comparing, specs

_DERIVED = ("bvh_", "mesh_graph", "mesh_poly", "mesh_extrema")
"""How names of arrays begin that the compiler makes of others; hulls of meshes that collide no more are kept in a spec."""
_SHORT_CUTS = {"body_margin", "body_sameframe", "geom_sameframe", "site_sameframe", "dof_length", "actuator_length0"}
"""What C MuJoCo derives of the rest, or uses as a short-cut."""
_PLACES = {"body_pos", "body_ipos", "geom_pos", "site_pos", "cam_pos", "light_pos", "jnt_pos", "qpos0", "qpos_spring"}
_PLACES |= {"geom_aabb", "key_qpos", "cam_pos0", "cam_poscom0", "light_pos0", "light_poscom0", "stat.center"}
"""Fields with places [m], which sums and turns round where they cancel out."""
_CANCELLED = 1e-12  # of the extent of the model
_NOTHING = 1e-30  # far less than MuJoCo's `mjMINVAL`
_VISUAL = ("global_", "quality", "headlight", "map", "scale", "rgba")


def proven(spec: mujoco.MjSpec, model: mujoco.MjModel, path: str) -> str:
    """The MJCF of a spec, of which MuJoCo compiles the same model.

    Args:
        spec: of one world.
        model: compiled from it.
        path: the argument that it comes from.

    Raises:
        ValueError: MuJoCo would compile another model, or none.
    """
    written = text(spec)
    try:
        again = mujoco.MjSpec.from_string(written, assets=dict(spec.assets)).compile()
    except ValueError as refused:
        raise error([problem(path, "unread_mjcf", text=specs.one_line(refused))]) from None
    if names := lost(model, again):
        raise error([problem(path, "lost_in_mjcf", names=names)])
    return written


def text(spec: mujoco.MjSpec) -> str:
    """MJCF of a spec, whose files have absolute paths there, with three things that MuJoCo leaves out.

    These are the numbers of a site's size that its type does not use, for which MJCF has another default, the `dampratio` of servos,
    which `<general>` has in its `biasprm` and MuJoCo replaces by the damping, and texts with characters that XML escapes.
    """
    spec = spec.copy()
    for name in ("savecompiled", "savecanonical"):  # as MuJoCo before 3.16 writes all
        if hasattr(spec.compiler, name):
            setattr(spec.compiler, name, True)
    specs.make_paths_absolute(spec, "arena.spec")
    order.put_frames_in_order(spec)
    model = spec.compile()
    try:
        root = ElementTree.fromstring(in_full(spec))
    except ElementTree.ParseError as refused:
        raise error([problem("arena.spec", "unread_mjcf", text=f"{refused}.")]) from None
    for element in root.iter("site"):
        if (name := element.get("name")) and spec.site(name) is not None:
            element.set("size", _numbers(model.site(name).size))
    for actuator, element in zip(spec.actuators, root.iterfind("actuator/*"), strict=True):
        if specs.has_dampratio(actuator):
            written = [float(x) for x in element.get("biasprm", "0 0 0").split()]
            element.set("biasprm", _numbers([*written[:2], actuator.biasprm[2], *written[3:]]))
    for element in root.iterfind("custom/text"):
        if element.text:  # which MuJoCo writes as CDATA, and does not read in another form
            element.set("data", element.text)
            element.text = None
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _numbers(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{x:.17g}" for x in np.asarray(values))


def lost(model: mujoco.MjModel, again: mujoco.MjModel) -> list[str]:
    """Names of what differs in another model by more than rounding in double precision, but for where files are."""
    found = {f"opt.{name}" for name in specs.other_options(again.opt, model.opt)}
    found |= {name for name in ("names", "text_data") if getattr(model, name) != getattr(again, name)}
    found |= {name for name in dir(model) if name.startswith("nuser") and getattr(model, name) != getattr(again, name)}
    found |= {f"vis.{name}" for name, value in _visual(model).items() if value != _visual(again)[name]}
    for name in comparing.differing(model, again) - _SHORT_CUTS:
        if not name.startswith(_DERIVED) and "path" not in name and not _rounded(model, again, name):
            found.add(name)
    return sorted(found)


def _visual(model: mujoco.MjModel) -> dict[str, Any]:
    parts = {part: getattr(model.vis, part) for part in _VISUAL}
    return {
        f"{part.strip('_')}.{name}": np.asarray(getattr(of, name)).tolist()
        for part, of in parts.items()
        for name in dir(of)
        if not name.startswith("_")
    }


def _rounded(model: mujoco.MjModel, again: mujoco.MjModel, name: str) -> bool:
    """Whether a field differs only in what is rounded, or used by nothing."""
    a, b = comparing.array(model, name), comparing.array(again, name)
    if a.shape != b.shape or a.dtype.kind != "f":
        return False
    if name in ("geom_size", "site_size"):
        kinds = map(mujoco.mjtGeom, getattr(model, name.replace("size", "type")))
        used = np.arange(3) < np.array([[SIZES.get(kind, 3)] for kind in kinds])
        a, b = np.where(used, a, 0.0), np.where(used, b, 0.0)
    nothing = _CANCELLED * model.stat.extent if name in _PLACES else _NOTHING
    return not (comparing.far_apart(model, name, a, b) & (np.abs(a - b) > nothing)).any()


def in_full(spec: mujoco.MjSpec) -> str:
    """MJCF of a compiled spec, in full precision.

    Raises:
        RuntimeError: this MuJoCo does not say how many digits it writes.
    """
    library = _library()
    if library is None:
        raise error([problem("mujoco", "six_digits")], kind=RuntimeError)
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(17)
    try:
        return spec.to_xml()
    finally:
        library._mjPRIVATE__set_xml_precision(before)


@functools.cache
def _library() -> ctypes.CDLL | None:
    """MuJoCo's library, as it is loaded; None where it does not say how many digits it writes, which is no public function."""
    folder = pathlib.Path(mujoco.__file__).parent
    for path in sorted((*folder.glob("libmujoco*"), *folder.glob("mujoco.dll"))):
        with contextlib.suppress(OSError):
            library = ctypes.CDLL(str(path))
            if hasattr(library, "_mjPRIVATE__set_xml_precision"):
                return library
    return None
