"""Attributes of MJCF elements that are the same in all worlds: why, and what to do instead (host).

docs/terms.md has the same table; `tests/test_terms_documented.py` holds that the two agree, and that MJX has none of them for each world.
"""

from typing import NamedTuple


class Constant(NamedTuple):
    """Attributes that cannot vary for one reason."""

    names: tuple[str, ...]  # as those of `ATTRIBUTES`; "flex.*" is all of a kind
    why: str  # a clause
    instead: str  # what to do, a clause


def _of(kind: str, *names: str) -> tuple[str, ...]:
    return tuple(f"{kind}.{name}" for name in names)


def _each(name: str, *kinds: str) -> tuple[str, ...]:
    return tuple(f"{kind}.{name}" for kind in kinds)


FLAGS = (
    *(
        "actuation",
        "autoreset",
        "clampctrl",
        "constraint",
        "contact",
        "damper",
        "diagexact",
        "energy",
        "equality",
        "eulerdamp",
    ),
    *("filterparent", "frictionloss", "fwdinv", "invdiscrete", "ipc", "island", "limit", "midphase", "multiccd"),
    *("nativeccd", "override", "refsafe", "sensor", "sleep", "speculative", "spring", "warmstart"),
)
"""The flags of the options, without `gravity`: `option.gravity` is a vector, too, which varies."""
TURNS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
SHORTCUTS = (
    *("posrange", "velrange", "ffrange"),
    *("cogging", "inductance", "lugre", "motorconst", "nominal", "resistance", "saturation", "thermal"),
)
"""What MJCF calls other numbers of motors and controllers."""
_COMPILED = "it is compiled into the step of all worlds"
_ARENAS = "make an arena for each"
_TERRAINS = "move and turn the field (`geom.pos`, `geom.rpy`), build the ground of boxes (`geom.size`), or make an arena for each terrain"
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
        _of("mesh", "vert", "scale", "file", "builtin", "content_type", "face", "inertia", "material", "maxhullvert")
        + _of("mesh", "normal", "params", "refpos", "refquat", "smoothnormal", "texcoord", "vertex"),
        "all worlds share the meshes",
        "give an object `variants`, each with a mesh of its own",
    ),
    Constant(
        _of("hfield", "data", "elevation"),
        "the compiler stretches heights to the size of their field, which all worlds share, and on Warp all worlds have one ground",
        _TERRAINS,
    ),
    Constant(
        _of("hfield", "size", "file", "content_type", "ncol", "nrow"), "all worlds share the height fields", _TERRAINS
    ),
    Constant(
        _each("group", "geom", "site", "joint", "tendon"),
        "all worlds share the groups",
        "make geoms transparent (`geom.rgba`)",
    ),
    Constant(_of("geom", "fluidshape", "fluidcoef"), "all worlds share how a medium drags", "vary `option.density`"),
    Constant(
        _of("geom", "shellinertia", "fitscale"),
        "all worlds share how sizes and masses are made of geoms",
        "vary `geom.size` and `geom.mass`",
    ),
    Constant(("geom.castshadow",), "all worlds share it", "vary `light.castshadow`"),
    Constant(
        _of("site", "size", "type", "rgba", "material", "mesh"),
        "all worlds share them",
        "let bodies with sites come and go (`body.active`)",
    ),
    Constant(
        _of("tendon", "material", "rgba", "width"),
        "no renderer of MJX draws tendons",
        "look at worlds in C MuJoCo (`c_world`)",
    ),
    Constant(
        _of("tendon", "coef", "divisor"),
        "all worlds share the paths of tendons",
        "vary what is on them (`site.pos`, `geom.pos`, `joint.pos`)",
    ),
    Constant(
        _of("body", "mocap", "sleep", "simple", "fuse") + _of("joint", "align", "actgravcomp", "actuatorgravcomp"),
        "all worlds share what is a degree of freedom, and of what kind",
        _ARENAS,
    ),
    Constant(
        ("joint.type", "equality.type"), "MJX counts degrees of freedom and constraints once for all worlds", _ARENAS
    ),
    Constant(
        _each("limited", "joint", "tendon")
        + _each("actfrclimited", "joint", "tendon")
        + _each("actuatorfrclimited", "joint", "tendon")
        + _of("actuator", "ctrllimited", "forcelimited", "actlimited"),
        "all worlds share the flag",
        "limit it in the MJCF, and vary the range (`joint.range`, `actuator.ctrlrange`, ...)",
    ),
    Constant(
        _of(
            "actuator",
            "gaintype",
            "biastype",
            "dyntype",
            "trntype",
            "actdim",
            "actearly",
            "group",
            "input",
            "controller",
        ),
        "all worlds share what an actuator is",
        "vary its numbers (`actuator.gainprm`, `actuator.biasprm`, `actuator.dynprm`)",
    ),
    Constant(
        _of("actuator", "armature", "damping"),
        "MJX adds it to that of the joint in `put_model`, or leaves it out",
        "vary `joint.armature`, `joint.damping` or those of tendons",
    ),
    Constant(
        _of("actuator", "delay", "nsample", "interp") + _of("sensor", "delay", "nsample", "interp", "interval"),
        "MJX begins delays otherwise than MuJoCo, or leaves them out",
        "vary `action_delay` and `observation_delay` of an `ArenaEnv`",
    ),
    Constant(
        _each("springyield", "joint", "tendon"),
        "MJX leaves it out",
        "vary `joint.stiffness` or `tendon.stiffness`",
    ),
    Constant(
        _of("camera", "resolution", "mode", "ipd", "output", "proj", "projection"),
        "pictures of all worlds have one size, and all worlds share how cameras follow",
        "add a camera for each",
    ),
    Constant(
        _of("light", "mode", "texture", "range", "intensity", "bulbradius", "softness"),
        "all worlds share it",
        "vary what is seen of a light (`light.pos`, `light.dir`, `light.diffuse`)",
    ),
    Constant(
        _of(
            "texture",
            "data",
            "file",
            "builtin",
            "colorspace",
            "content_type",
            "embed",
            "gridlayout",
            "gridsize",
            "height",
        )
        + _of("texture", "hflip", "mark", "markrgb", "nchannel", "random", "rgb1", "rgb2", "type", "vflip", "width")
        + tuple(f"texture.file{side}" for side in ("back", "down", "front", "left", "right", "up"))
        + _of("material", "reflectance", "metallic", "roughness", "role"),
        "all worlds share what textures and mirrors show",
        "give the MJCF several textures, and vary `material.texture` or `material.rgba`",
    ),
    Constant(
        ("sensor.noise", "sensor.cutoff"),
        "all worlds share it, and no step adds noise",
        "add noise to what your environment observes",
    ),
    Constant(
        _of(
            "sensor", "objname", "objtype", "refname", "reftype", "actuator", "body", "body1", "body2", "camera", "geom"
        )
        + _of("sensor", "geom1", "geom2", "joint", "mesh", "site", "subtree1", "subtree2", "tendon", "data", "enclosed")
        + _of("sensor", "num", "reduce"),
        "all worlds share what sensors measure",
        "add a sensor for each",
    ),
    Constant(
        _of("key", "qpos", "qvel", "ctrl", "act", "mpos", "mquat", "plastic", "time"),
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
        )
        + _of(
            "option", "ccd_iterations", "noslip_iterations", "sdf_initpoints", "sdf_iterations", "actuatorgroupdisable"
        )
        + _of("option", *FLAGS),
        _COMPILED,
        "set it in the MJCF, and make an arena for each",
    ),
    Constant(
        _of("option", "tolerance", "ls_tolerance", "ccd_tolerance", "noslip_tolerance", "sleep_tolerance"),
        "it is no number of a world, but says how exactly a step solves it",
        "set it in the MJCF",
    ),
    Constant(
        _of("option", "o_friction", "o_margin", "o_solimp", "o_solref"),
        "all contacts of all worlds share it",
        "vary `geom.friction`, `geom.margin`, `geom.solimp` or `geom.solref`",
    ),
    Constant(_each("*", "flex", "skin"), "all worlds share what is deformable", _ARENAS),
    Constant(
        ("statistic.*",),
        "the compiler makes it of masses, sizes and places",
        "vary these (`body.mass`, `geom.size`, `body.pos`)",
    ),
    Constant(
        ("visual.*",),
        "all worlds share how they are shown",
        "vary lights and colours (`light.diffuse`, `geom.rgba`, `material.rgba`)",
    ),
    Constant(
        _each("*", "numeric", "text", "tuple"), "no step reads it", "draw what your environment reads in `draw_task`"
    ),
    Constant(_each("*", "compiler", "size"), "it only says how the MJCF is read", _ARENAS),
    # What varies by another name.
    Constant(
        _of("camera", "look_at", "target"),
        "it only says how a camera is turned in the arena",
        "vary `camera.rpy` for where it looks, and `camera.pos` for where it is",
    ),
    Constant(
        tuple(f"{kind}.{turn}" for kind in ("body", "geom", "site", "camera") for turn in TURNS),
        "orientations vary by angles that are composed with the compiled one",
        "vary `body.rpy`, `geom.rpy`, `site.rpy` or `camera.rpy`",
    ),
    Constant(
        _each("fromto", "geom", "site"),
        "the compiler makes a pose and a size of it",
        "vary `geom.pos`, `geom.rpy` and `geom.size`, or `site.pos`",
    ),
    Constant(
        ("body.fullinertia",),
        "the compiler makes principal moments of it",
        "vary `body.inertia` or `body.pseudo_inertia`",
    ),
    Constant(
        ("joint.springdamper",),
        "the compiler makes a stiffness and a damping of it",
        "vary `joint.stiffness` and `joint.damping`",
    ),
    Constant(
        _of("equality", "anchor", "polycoef", "relpose", "torquescale"),
        "an equality has it among its numbers",
        "vary `equality.data`",
    ),
    Constant(("actuator.inheritrange",), "the compiler makes a range of it", "vary `actuator.ctrlrange`"),
    Constant(
        _of("actuator", "timeconst", "tausmooth", "imax", "slewmax"),
        "an actuator has it among its numbers",
        "vary `actuator.dynprm`",
    ),
    Constant(("actuator.bias",), "an actuator has it among its numbers", "vary `actuator.biasprm`"),
    Constant(("actuator.ki",), "an actuator has it among its numbers", "vary `actuator.gainprm`"),
    Constant(
        _of("actuator", *SHORTCUTS),
        "the compiler makes other numbers of it",
        "vary `actuator.gainprm`, `actuator.biasprm`, `actuator.dynprm` or `actuator.ctrlrange`",
    ),
    Constant(
        _of("camera", "focalpixel", "principalpixel", "sensorsize"),
        "the compiler makes lengths of it",
        "vary `camera.focal` and `camera.principal`",
    ),
    Constant(("light.directional",), "the compiler makes a type of it", "vary `light.type`"),
)
"""The attributes that stay, in the order of the table in docs/terms.md."""
FIXED = {name: row for row in ROWS for name in row.names}
"""The same rows, by the attribute's name."""


def constant(attribute: str) -> Constant | None:
    """The row of an attribute, or of all attributes of its kind; None if there is none."""
    return FIXED.get(attribute) or FIXED.get(f"{attribute.partition('.')[0]}.*")
