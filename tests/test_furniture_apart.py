"""Part against part: what is flagged as overlapping is what overlaps in the compiled world, by C MuJoCo's distances between the boxes."""

import itertools

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture

KINDS = {
    "shelf": furniture.Shelf,
    "bin": furniture.Bin,
    "counter": furniture.Counter,
    "corner": lambda name, **at: furniture.Counter(name, widths=(0.5, 0.6, 0.5, 0.4), corner=(1, 3), **at),
    "drawers": furniture.Drawers,
    "cupboard": furniture.Cupboard,
    "wall": furniture.Wall,
    "window": lambda name, **at: furniture.Wall(name, window=(1.2, 0.9), **at),
    "door": lambda name, **at: furniture.Wall(name, door=(0.9, 2), **at),
    "steps": furniture.Steps,
    "ramp": furniture.Ramp,
    "rail": furniture.Rail,
}
FEW = ("shelf", "corner", "cupboard", "window", "ramp")
NEAR = 1e-5  # [m] nothing is told of what is as close: float32 rounds coordinates of 8 m by 5e-7, C's distances have a tolerance of 1e-6


def two_of_each(kinds):
    """An arena with these parts far from each other."""
    arena = mja.TableArena(table_offset=(-6, 0, 0.8))
    for i, name in enumerate(kinds):
        for k in range(2):
            arena.add_part(KINDS[name](f"{name}{k}", pos=(6.0 * i, 8 + 8.0 * k, 0)))
    return arena


def drawn(arena, pairs):
    """Parameters of worlds in which the two parts of a pair alone are there, at random places, yaws, sizes and openings."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    sizes = [name for name in nominal.terms if name.split(".")[1] in SIZES]
    opened = {name: dist for name, dist in OPEN.items() if name in nominal.terms}
    ranges = mja.ArenaRanges(terms=dict.fromkeys(sizes, mja.Uniform(0.86, 1.0, relative="scale")) | opened)
    keys = mja.world_keys(0, range(len(pairs)))
    params = jax.tree.map(np.array, jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys))
    rng, names = np.random.default_rng(0), [part.name for part in arena.record.parts.places.furniture]
    for w, pair in enumerate(pairs):
        there, far = [f"{pair[0]}0", f"{pair[1]}1"], (0.4, 1.5)[w * 2 // len(pairs)]
        for name in names:
            params.terms[f"{name}.active"][w] = name in there
        for name in there:
            params.terms[f"{name}.rot"][w] = rng.uniform(-3.2, 3.2)
            params.terms[f"{name}.pos"][w] = [*rng.uniform(-far, far, 2), rng.choice([0.0, rng.uniform(0, far)])]
    return params


SIZES = ("size", "heights", "inner_size", "widths", "depth", "full_size", "rises", "run", "rise", "width", "length")
OPEN = {f"drawers{k}.openings": mja.Uniform(0.0, 0.28) for k in range(2)}
OPEN |= {f"cupboard{k}.opening": mja.Uniform(0.0, 1.8) for k in range(2)}


def distance(model, data, one, other):
    """The least of those between geoms of two parts, up to a metre; below 0 how deep the deepest is."""
    geoms = [[g for g in range(model.ngeom) if model.geom(g).name.startswith(f"{name}_")] for name in (one, other)]
    assert all(geoms)
    return min(mujoco.mj_geomDistance(model, data, a, b, 1.0, None) for a in geoms[0] for b in geoms[1])


@pytest.mark.slow
@pytest.mark.parametrize(("kinds", "each"), [(FEW, 2), pytest.param(tuple(KINDS), 6, marks=pytest.mark.xslow)])
def test_flags_are_cs(kinds, each):
    """Of a ramp the upright box around it counts: what touches is flagged, and more may be. Most pairs touch, and most do not."""
    of_kinds = list(itertools.combinations_with_replacement(kinds, 2))
    pairs, arena, touching = of_kinds * each, two_of_each(kinds), {False: set(), True: set()}
    params = drawn(arena, pairs)
    valid = np.asarray(jax.jit(jax.vmap(arena.valid))(params))
    for w, pair in enumerate(pairs):
        own = jax.tree.map(lambda x, w=w: x[w], params)
        model, data = arena.c_world(own)
        names = f"{pair[0]}0", f"{pair[1]}1"
        away = distance(model, data, *names)
        if abs(away) < NEAR:
            continue
        told = arena.problems(own)
        assert bool(told) != valid[w], pair
        assert all(f"Part '{names[0]}' and part '{names[1]}' overlap" in one for one in told), told
        if "ramp" not in pair or away < 0:
            assert valid[w] == (away > 0), (pair, away)
        touching[away < 0].add(pair)
    assert min(map(len, touching.values())) > 0.7 * len(of_kinds)
