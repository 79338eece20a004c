"""What decides, beside its parameters, whether a world can be: written to a bundle and read from it (host). K objects."""

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from mjx_arenas.files.schema import Reader
from mjx_arenas.files.writer import Writer
from mjx_arenas.furniture import standing
from mjx_arenas.furniture.part import Part
from mjx_arenas.params.distributions import Workspace
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import Told, numbered, problem, under
from mjx_arenas.problems import messages
from mjx_arenas.record.record import Record
from mjx_arenas.rules import fixed_rules, validation_worlds
from mjx_arenas.rules.validation_worlds import Rules
from mjx_arenas.sample import placement, poses, tops
from mjx_arenas.sample.fixed import NOTHING, Fixed, Near, of_world
from mjx_arenas.sample.variants import of_chosen, which
from mjx_arenas.spec import calls
from mjx_arenas.spec.follow import Follower
from mjx_arenas.terms.furniture import Furniture


def write(record: Record, params: ArenaParams, ranges: ArenaRanges) -> dict[str, Any]:
    """The rules of a world, as numbers, lists and words; of `arena.vary` what they say of it, as their bounds are functions."""
    rules, space = record.rules, ranges.workspace
    kept = None if space is None else [np.asarray(x).tolist() for x in (space.low, space.high, space.gap)]
    overlapping = [] if rules.overlapping is None else np.argwhere(np.triu(rules.overlapping, 1)).tolist()
    held = {str(i): why for i, why in rules.held.items()}
    about: dict[str, Any] = {"held": held, "workspace": kept, "overlapping": overlapping}
    if rules.follows:
        about["follows"] = [dataclasses.asdict(one) for one in rules.follows]
    if rules.inside is not None:
        own = of_world(rules.fixed, params)
        found = {**own._asdict(), "near_on": own.near.on, "near": own.near.at, "moving": None, "presence": None}
        about["fixed"] = {name: np.asarray(x).tolist() for name, x in found.items()}
        about["inside"] = np.argwhere(rules.inside).tolist()
        for name in ("sunk", "low"):
            value = getattr(rules, name)
            about[name] = None if value is None else np.flatnonzero(value).tolist()
    if rules.furniture and rules.touching is not None:
        writer = Writer(pathlib.Path("failure.json"))
        about["furniture"] = [
            writer.named(calls.plain(part), ("furniture", i)) for i, part in enumerate(rules.furniture)
        ]
        about["touching"] = np.argwhere(np.triu(rules.touching)).tolist()
    problems = validation_worlds.world_problems(params, validation_worlds.bound(rules, ranges))
    about["of_terms"] = [messages.sentence(one) for one in problems if one.path.startswith("terms.")]
    return about | _as_there(record, params)


def _as_there(record: Record, params: ArenaParams) -> dict[str, Any]:
    """What objects are, those with variants as the ones that are there."""
    places, rules, terms = record.layout.places, record.rules, params.terms
    types = rules.object_kinds.tolist()
    for one in places.variants:
        types[one.object] = str(one.kind[int(which(one, terms))])
    sizes = np.asarray(of_chosen(places.variants, terms, "full_size", rules.object_full_sizes)).tolist()
    carriers = [one._asdict() for one in places.carriers]
    return {"types": types, "sizes": sizes, "poses": _poses(places, params), "carriers": carriers}


def _poses(places: placement.Places, params: ArenaParams) -> list[dict[str, Any]]:
    """The poses of objects, of those with variants of the one that is there."""
    found = []
    for one in places.poses:
        variant = next((int(which(v, params.terms)) for v in places.variants if v.object == one.object), 0)
        own = poses.of_variant(one, variant)._asdict()
        found.append({name: x.tolist() if isinstance(x, np.ndarray) else x for name, x in own.items()})
    return found


def read(data: dict[str, Any], tables: tuple[str, ...], objects: tuple[str, ...]) -> Rules:
    """The rules of a world, of tables and objects of these names.

    Raises:
        ValueError: something in them is wrong.
    """
    n_tables = len(tables)
    held = {int(i): str(why) for i, why in data["held"].items()}
    most = n_tables + len(objects) - 1
    if not all(0 <= i <= most for i in held):
        raise messages.error(
            [problem("rules.held", "must", None, Told(", ".join(map(str, held))), must=f"by numbers from 0 to {most}")]
        )
    space = None if data["workspace"] is None else Workspace(*(np.asarray(x, float) for x in data["workspace"]))
    if space is not None and space.problems():
        raise messages.error(under("rules.workspace", space.problems()[:1], dist=""))
    kinds, sizes = np.asarray(data["types"], str), shaped("rules.sizes", data["sizes"], (len(objects), 3))
    if kinds.size != len(objects):
        raise messages.error(
            [problem("rules.types", "must", None, kinds.size, must=f"of the {len(objects)} objects of params.json")]
        )
    overlapping = None  # of a bundle that does not say it, any may
    if "overlapping" in data:
        overlapping = _pairs(data["overlapping"], n_tables)
    follows = tuple(_follower(node, n_tables) for node in data.get("follows", ()))
    rules = Rules(n_tables, objects, kinds.reshape(-1), sizes, held, True, space, overlapping, follows=follows)
    rules = rules._replace(tables=numbered(tables))
    carriers = tuple(tops.Carrier(**one) for one in data.get("carriers", ()))
    rules = rules._replace(poses=tuple(_read_poses(one) for one in data.get("poses", ())), carriers=carriers)
    parts = tuple(_part(node) for node in data.get("furniture", ()))
    if not parts:
        return _with_fixed(rules, data)
    terms = {one.name: one.selected for part in parts for one in Furniture(part).numbers}
    touching = _pairs(data["touching"], n_tables + len(standing.owners(parts)))
    return _with_fixed(rules._replace(terms=terms, furniture=parts, touching=touching), data)


def _with_fixed(rules: Rules, data: dict[str, Any]) -> Rules:
    """What is fixed beside tables and parts, and what is in it by intent."""
    if "fixed" not in data:
        return rules
    own = data["fixed"]
    arrays: dict[str, Any] = {
        n: np.array(own.get(n, [0] * len(own["on"])), x.dtype).reshape(-1, *x.shape[1:])  # `under` and `gone` are new
        for n, x in NOTHING._asdict().items()
        if isinstance(x, np.ndarray)
    }
    near = Near(np.array(own.get("near_on", []), int), np.array(own.get("near", []), float).reshape(-1, 2))
    fixed = Fixed(**arrays, names=tuple(own["names"]), floor=own["floor"], near=near)
    pairs = np.zeros((len(fixed_rules.owners(rules)), len(fixed.on) + len(rules.follows)), bool)
    pairs[tuple(np.array(data["inside"], int).reshape(-1, 2).T)] = True
    sunk = None if data["sunk"] is None else np.isin(np.arange(len(rules.furniture)), data["sunk"])
    given = data.get("low")  # which is new: any may
    low = None if given is None else np.isin(np.arange(rules.n_tables), given)
    return rules._replace(fixed=fixed, inside=pairs, sunk=sunk, low=low)


def _read_poses(node: Mapping[str, Any]) -> poses.Poses:
    """The poses of an object."""
    own: dict[str, Any] = {name: np.asarray(x) if isinstance(x, list) else x for name, x in node.items()}
    return poses.Poses(**own)


def _follower(node: Mapping[str, Any], n_tables: int) -> Follower:
    """A geom that follows one of the tables."""
    own: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in node.items()}
    one = Follower(**own)
    if one.table not in range(n_tables):
        raise messages.error(
            [problem("rules.follows", "must", None, one.table, must=f"of tables from 0 to {n_tables - 1}")]
        )
    return one


def of_parts(terms: Mapping[str, Any], rules: Rules) -> dict[str, np.ndarray]:
    """The quantities of furniture, of the right shapes and kinds."""
    wanted = {name: (one.quantity, len(one.elements)) for name, one in rules.terms.items()}
    return {name: shaped(name, terms[name], (n, *q.item)).astype(q.kind) for name, (q, n) in wanted.items()}


def _pairs(pairs: Any, n: int) -> np.ndarray:
    """(n, n) bool: what is true of some pairs of n things."""
    found = np.zeros((n, n), bool)
    found[tuple(np.asarray(pairs, int).reshape(-1, 2).T)] = True
    return found | found.T


def _part(node: Any) -> Part:
    """A part of furniture, of a kind that is known."""
    reader = Reader(pathlib.Path("failure.json"), {})
    part = reader.instance(node, Part, ("rules", "furniture"))
    if reader.problems or part is None or part.problems():
        kind = next(iter(node)) if isinstance(node, dict) and node else node
        raise ValueError(f"{kind!r} is no part of furniture that is known here: import what defines it first")
    return part


def shaped(name: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Numbers of a shape; where there are none of them, of any."""
    array = np.asarray(value, float)
    if array.shape != shape and (array.size or 0 not in shape):
        raise messages.error([problem(name, "shape", None, array.shape, want=shape, shape=array.shape)])
    return array.reshape(shape)
