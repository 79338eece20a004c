"""Attributes of MJCF elements that are the same in all worlds: why, and what to do instead (host).

docs/terms.md has the same table; `tests/test_terms_documented.py` holds that the two agree, and that MJX has none of them for each world.
"""

from typing import NamedTuple


class Constant(NamedTuple):
    """Attributes that cannot vary for one reason."""

    names: tuple[str, ...]  # as those of `ATTRIBUTES`
    why: str  # a clause
    instead: str  # what to do, a clause


def _of(kind: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{kind}.{name}" for name in names)


_COMPILED = "it is compiled into the step of all worlds"
_ARENAS = "make an arena for each"
ROWS = (
    Constant(
        _of("geom", "contype", "conaffinity"),
        "MJX finds the pairs of geoms that may touch once for all worlds",
        "let bodies come and go (`body.active`), or objects (`object_active`)",
    ),
    Constant(
        ("geom.condim", "pair.condim"),
        "MJX counts the rows of a contact once for all worlds",
        "give the MJCF the largest, and vary the axes of `friction`",
    ),
    Constant(
        ("geom.priority",),
        "MJX decides once whose friction counts",
        "vary `geom.friction` of the geom that has the priority",
    ),
    Constant(
        _of("geom", "type", "dataid", "mesh", "meshname", "hfield", "hfieldname"),
        "all worlds share the kinds of geoms and which meshes they have",
        "give an object `variants`, or let bodies of several shapes come and go (`body.active`)",
    ),
    Constant(
        _of("mesh", "vert", "scale", "file"),
        "all worlds share the meshes",
        "give an object `variants`, each with a mesh of its own",
    ),
    Constant(
        _of("hfield", "data", "elevation", "size", "file"),
        "all worlds share the height fields",
        "move and turn the field (`geom.pos`, `geom.rpy`), build the ground of boxes (`geom.size`), or make an arena for each terrain",
    ),
    Constant(("geom.group", "site.group"), "all worlds share the groups", "make geoms transparent (`geom.rgba`)"),
    Constant(_of("geom", "fluidshape", "fluidcoef"), "all worlds share how a medium drags", "vary `option.density`"),
    Constant(
        _of("site", "size", "type", "rgba"),
        "all worlds share them",
        "let bodies with sites come and go (`body.active`)",
    ),
    Constant(
        ("joint.type", "equality.type"), "MJX counts degrees of freedom and constraints once for all worlds", _ARENAS
    ),
    Constant(
        ("joint.limited", "tendon.limited", *_of("actuator", "ctrllimited", "forcelimited", "actlimited")),
        "all worlds share the flag",
        "limit it in the MJCF, and vary the range (`joint.range`, `actuator.ctrlrange`, ...)",
    ),
    Constant(
        _of("actuator", "gaintype", "biastype", "dyntype", "trntype"),
        "all worlds share what an actuator is",
        "vary its numbers (`actuator.gainprm`, `actuator.biasprm`, `actuator.dynprm`)",
    ),
    Constant(
        _of("camera", "resolution", "mode"),
        "pictures of all worlds have one size, and all worlds share how cameras follow",
        "add a camera for each",
    ),
    Constant(
        ("light.mode", "light.texture", "light.range", "light.intensity", "light.bulbradius"),
        "all worlds share it",
        "vary what is seen of a light (`light.pos`, `light.dir`, `light.diffuse`)",
    ),
    Constant(
        ("texture.data", "texture.file", "material.reflectance"),
        "all worlds share what textures and mirrors show",
        "give the MJCF several textures, and vary `material.texture` or `material.rgba`",
    ),
    Constant(
        ("sensor.noise", "sensor.cutoff"),
        "all worlds share it, and no step adds noise",
        "add noise to what your environment observes",
    ),
    Constant(
        ("key.qpos", "key.qvel", "key.ctrl"),
        "all worlds share keyframes",
        "vary `joint.qpos` and `joint.qvel`, which are added to them",
    ),
    Constant(
        _of(
            "option",
            "integrator",
            "cone",
            "solver",
            "jacobian",
            "iterations",
            "ls_iterations",
            "disableflags",
            "enableflags",
        ),
        _COMPILED,
        "set it in the MJCF, and make an arena for each",
    ),
)
"""In the order of the table."""
FIXED = {name: row for row in ROWS for name in row.names}
"""By the attribute's name."""
