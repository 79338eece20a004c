"""MJCF of an arena and of its worlds, in full precision (host)."""

from collections.abc import Mapping
from xml.etree import ElementTree

import mujoco
import numpy as np

from mjx_arenas.build import order
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.spec import comparing, specs


def text(spec: mujoco.MjSpec) -> str:
    """MJCF of a spec, whose files have absolute paths there, with two things that MuJoCo leaves out.

    These are the numbers of a site's size that its type does not use, for which MJCF has another default, and the `dampratio` of servos,
    which `<general>` has in its `biasprm` and MuJoCo replaces by the damping.
    """
    return _written(spec)[0]


def proven(spec: mujoco.MjSpec, path: str) -> str:
    """The same, if MuJoCo compiles it to the model that it makes of the spec.

    Raises:
        ValueError: about the argument `path`; it does not.
    """
    written, model = _written(spec)
    lost = _lost(written, dict(spec.assets), model)
    if lost:
        raise error([problem(path, "lost_in_mjcf", names=lost)])
    return written


def _written(spec: mujoco.MjSpec) -> tuple[str, mujoco.MjModel]:
    spec = spec.copy()
    specs.make_paths_absolute(spec, "arena.spec")
    order.put_frames_in_order(spec)
    model = spec.compile()
    root = ElementTree.fromstring(specs.to_xml(spec))
    for element in root.iter("site"):
        if element.get("name"):
            element.set("size", _numbers(spec.site(element.get("name")).size))
    for actuator, element in zip(spec.actuators, root.iterfind("actuator/*"), strict=True):
        if specs.has_dampratio(actuator):
            element.set("biasprm", _numbers(actuator.biasprm))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode"), model


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{x:.17g}" for x in np.asarray(values))


def _lost(written: str, assets: Mapping[str, bytes], model: mujoco.MjModel) -> list[str]:
    """Names of the model's numbers that this MJCF does not give back."""
    again = specs.compiled(mujoco.MjSpec.from_string(written, assets=dict(assets)), "arena.spec")
    options = {f"opt.{name}" for name in specs.other_options(again.opt, model.opt)}
    return sorted(options | comparing.differing(model, again) - comparing.NOT_READ)
