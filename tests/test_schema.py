"""MJCF's own schema: each attribute of an element varies, or is told why it does not and what to do instead."""

import re

import mujoco

from mjx_arenas import dr
from mjx_arenas.terms.attributes.fixed import constant

OTHER = {
    "default", "extension", "asset/model", "worldbody/attach", "worldbody/flexcomp", "worldbody/plugin", "contact/exclude",
    "actuator/plugin", "sensor/plugin", "sensor/user",
}  # fmt: skip
"""No elements that terms have: those that make others, pairs that do not touch, plugins and numbers of the user."""
KINDS = {
    "option": "option", "asset/mesh": "mesh", "asset/hfield": "hfield", "asset/texture": "texture", "asset/material": "material",
    "worldbody/inertial": "body", "worldbody/joint": "joint", "worldbody/freejoint": "joint", "worldbody/geom": "geom",
    "worldbody/site": "site", "worldbody/camera": "camera", "worldbody/light": "light", "worldbody": "body", "contact/pair": "pair",
    "tendon": "tendon", "equality": "equality", "actuator": "actuator", "sensor": "sensor", "keyframe": "key",
    "compiler": "compiler", "size": "size", "statistic": "statistic", "visual": "visual", "asset/skin": "skin", "deformable/flex": "flex",
    "deformable/skin": "skin", "custom/numeric": "numeric", "custom/text": "text", "custom/tuple": "tuple",
}  # fmt: skip
"""By the path of an element, or the beginning of it."""
NAMES = {"name", "class", "childclass", "user"}
OF = {
    "tendon": {"site", "geom", "sidesite", "joint"},
    "equality": {"body1", "body2", "site1", "site2", "joint1", "joint2", "tendon1", "tendon2", "flex", "cell"},
    "actuator": {"joint", "jointinparent", "site", "refsite", "body", "tendon", "cranksite", "slidersite"},
    "pair": {"geom1", "geom2"},
    "camera": {"target"},
    "light": {"target"},
}
"""What an element is of."""
SPELLED = {
    "body.diaginertia": "body.inertia",
    "joint.actuatorfrcrange": "joint.actfrcrange",
    "tendon.actuatorfrcrange": "tendon.actfrcrange",
    **{f"{kind}.{a}{of}": f"{kind}.{a}_{of}" for kind in ("joint", "tendon") for a in ("solref", "solimp") for of in ("limit", "friction")},
}  # fmt: skip
"""Attributes that `MjSpec` calls otherwise."""


def schema():
    """(path, attributes) of all elements."""
    found, path = [], []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        head = re.match(r"( *)(\(world\)body|[\w]+) \([!?*R]\) *(.*)", line)
        if head:
            depth = len(head[1]) // 3
            path = [*path[:depth], head[2].replace("(world)body", "worldbody")]
            found.append(("/".join(path[1:]), set(head[3].split())))
        else:
            found[-1][1].update(line.split())
    return found


def attributes():
    """All attributes of elements, by the kind and MJCF's name."""
    found = set()
    for path, names in schema():
        left_out = any(path == other or path.startswith(f"{other}/") for other in OTHER)
        if names and path and not left_out and "plugin" not in path:
            parts = path.split("/")
            kind = next(KINDS[p] for p in ("/".join(parts[:n]) for n in (3, 2, 1)) if p in KINDS)
            found |= {f"{kind}.{name}" for name in names - NAMES - OF.get(kind, set())}
    return found


def test_each_varies_or_is_told():
    missing = {n for n in attributes() if SPELLED.get(n, n) not in dr.ATTRIBUTES and constant(n) is None}
    assert missing == set()
