"""What is wrong with the objects of an arena, and what each one stands on (host)."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mujoco

from mjx_arenas.keywords import letters, nearest
from mjx_arenas.problem import Item, Problem, problem
from mjx_arenas.rules.validation import table_index
from mjx_arenas.spec.objects import Object
from mjx_arenas.spec.of_scene import SceneObject
from mjx_arenas.spec.place import moving_problems


def object_problems(
    objects: object,
    table_names: Sequence[str] | None,
    spec: mujoco.MjSpec,
    slab_names: Sequence[str] = (),
    of_scene: bool = False,
    before: Sequence[Object] = (),
) -> tuple[list[Problem], list[int | str]]:
    """What is wrong with the objects of an arena, and the index of each one's table or surface, or the name of the object that carries it.

    Args:
        objects: what was given.
        table_names: None: not known.
        spec: to which they come.
        slab_names: of the tables.
        of_scene: whether a `SceneObject` is of that spec.
        before: objects that the arena has.
    """
    taken = {e.name for e in (*spec.bodies, *spec.geoms, *spec.joints)} | set(table_names or ())
    if isinstance(objects, Object):
        return [problem("objects", "one_object", name=objects.name)], []
    if isinstance(objects, str) or not isinstance(objects, Iterable):
        return [problem("objects", "objects", None, objects)], []
    problems, tables = list[Problem](), list[int | str]()
    carriers = {o.name: o for o in before}
    seen: set[str] = set()
    made: set[str] = set()
    objects = list(objects)
    for k, obj in enumerate(objects):
        if not isinstance(obj, Object):
            problems.append(problem("objects", "object", ("entry", k), obj, i=k))
            continue
        own = obj.problems()
        problems += own
        item = ("object", obj.name)
        if obj.place is not None and not own:
            problems += moving_problems("objects.place.near", item, obj.place.near, spec)
        geoms = {one.geom for one in (not own and obj.slots) or (obj,)}
        if obj.name in seen:
            problems.append(problem("objects.name", "named_twice", item, name=obj.name))
        elif isinstance(obj, SceneObject):
            problems += [] if of_scene else [problem("objects", "scene_other", item)]
        elif {obj.name, obj.joint} & taken or geoms & (taken | made):
            problems.append(problem("objects.name", "taken", item))
        seen.add(obj.name)
        made |= geoms
        if table_names is None:
            continue
        later = [o.name for o in objects[k + 1 :] if isinstance(o, Object)]
        on = _below(obj.on, table_names, slab_names, carriers, later, item)
        carriers[obj.name] = obj
        problems += on if isinstance(on, list) else []
        tables += [] if isinstance(on, list) else [on]
    return problems, tables


def _below(
    on: object,
    table_names: Sequence[str],
    slab_names: Sequence[str],
    carriers: Mapping[str, Object],
    later: Sequence[str],
    item: Item,
) -> int | str | list[Problem]:
    """The index of a table or surface, or the name of an object before it; or why an object cannot stand there."""
    table = table_index(on, table_names, slab_names)
    if isinstance(on, str) and on in carriers:
        return _carrier_problems(carriers[on], item) or on
    if table is None and on in later:
        return [problem("objects.on", "carried_later", item, on)]
    if table is not None:
        return table
    rule = "table" if table_names else "on_no_table"
    told: dict[str, Any] = {"tables": tuple(table_names)}
    close = nearest(on, (*table_names, *slab_names, *carriers)) if isinstance(on, str) else None
    if close and letters(close) != letters(str(on)):  # another number is no misspelling
        told["later"] = f": {close!r} may be meant"
    elif isinstance(on, str) and ("object", on) != item:
        told["later"] = (
            ": furniture that carries it must be added first, by `add_part`, and the object then by `add_object`"
        )
    return [problem("objects.on", rule, item, on, told)]


def _carrier_problems(carrier: Object, item: Item) -> list[Problem]:
    """Why nothing stands on an object."""
    resting, kinds = carrier.pose != "upright", {one.kind for one in carrier.variants or (carrier,)}
    level = kinds == {"cylinder"} and not resting
    if level or (kinds == {"box"} and not (resting and carrier.slots)):
        dropped = carrier.place is not None and bool(carrier.place.drop)
        return [problem("objects.on", "carrier_dropped", item, carrier.name)] if dropped else []
    kind = "an MJCF body" if carrier.kind == "mjcf" else f"a {carrier.kind}"
    mixed = f"has variants{' in any resting pose' if resting else ', which are not all boxes or all cylinders'}"
    what = mixed if carrier.slots else f"is {kind}{' in any resting pose' if resting else ''}"
    return [problem("objects.on", "carrier_top", item, carrier.name, what=what)]
