"""The tables and objects of an arena, and what follows them, found in a user's scene (host)."""

import dataclasses
import os
from collections.abc import Iterable, Sequence
from typing import Any

import mujoco

from mjx_arenas.build import assemble, following, from_mjcf, scene_objects
from mjx_arenas.params.params import ArenaParams
from mjx_arenas.rules import validation, validation_objects
from mjx_arenas.spec import masses, specs
from mjx_arenas.spec.follow import Follow
from mjx_arenas.spec.objects import Object
from mjx_arenas.spec.of_scene import SCENE
from mjx_arenas.terms.parts import Parts


def asked(given: Any) -> Any:
    """The objects of a call, of which a string asks for a free body of the scene; what are none are as they came."""
    if isinstance(given, (str, Object)) or not isinstance(given, Iterable):
        return given
    return [Object(one, SCENE) if isinstance(one, str) else one for one in given]


def adopt(
    xml: str | os.PathLike | mujoco.MjSpec, tables: Sequence[str], objects: Any, priority: int, follow: Sequence[Follow]
) -> tuple[mujoco.MjSpec, Parts, ArenaParams]:
    """Spec, parts and nominal parameters of an arena; `objects` as of `asked`. See `Arena.from_xml`.

    Raises:
        ValueError: all problems of the call.
    """
    spec = specs.read(xml, "xml")
    if tables or objects:
        masses.allow_inertials(spec)
    names, table_params = from_mjcf.adopt_tables(spec, tables, priority)
    bodies, slabs = [n.body for n in names], [n.collision for n in names]
    follows = following.adopt(spec, names, table_params, follow)
    own, problems = scene_objects.adopt(spec, names, objects)
    found, object_tables = validation_objects.object_problems(own, bodies, spec, slabs, of_scene=True)
    validation.raise_all([*problems, *found, *validation.table_option_problems(priority, None)], "from_xml")
    parts, nominal = assemble.with_objects(spec, names, table_params, own, object_tables, priority)
    assemble.raise_condim(spec, parts)
    return spec, dataclasses.replace(parts, follows=follows, places=parts.places._replace(follows=follows)), nominal
