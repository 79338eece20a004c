"""Draws of terms against a plain loop over elements and axes: any selection, distribution, `relative` and `tied` (host)."""

import math
import re
import zlib

import jax
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.distributions import SUM_ERROR

XML = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="arm" pos=".1 .2 1"><joint name="arm_a" axis="0 1 0" damping=".1" stiffness="2"/>
<geom name="arm_box" type="box" size=".1 .2 .3"/>
<geom name="arm_rod" type="capsule" size=".05 .2" pos=".3 0 0"/>
<body name="hand" pos=".4 .1 .2"><joint name="hand_b" axis="1 0 0" damping=".2" stiffness="3"/><geom name="hand_ball" size=".07"/>
<geom name="hand_tin" type="cylinder" size=".06 .1" pos="0 0 .2"/></body></body>
<body name="leg" pos="2 .1 1"><joint name="leg_c" axis="0 0 1" damping=".3" stiffness="4"/><geom name="leg_box" type="box" size=".2 .1 .1"/>
<geom type="sphere" size=".1" pos=".2 0 0"/></body></worldbody>
<actuator><motor name="arm_m" joint="arm_a" gear="2"/><motor name="leg_m" joint="leg_c" gear="3"/></actuator></mujoco>"""
AXES = {
    "geom.friction": ("sliding", "torsional", "rolling"),
    "geom.rgba": ("red", "green", "blue", "alpha"),
    "geom.size": ("first", "second", "third"),
    "body.pos": ("x", "y", "z"),
    "joint.damping": (),
    "joint.stiffness": (),
    "geom.solmix": (),
}
SIZED = {
    "arm_box": 3,
    "arm_rod": 2,
    "hand_ball": 1,
    "hand_tin": 2,
    "leg_box": 3,
    "leg/geom0": 1,
}  # the last has no name: the library gives one
NAMED = {
    "geom": ["floor", *SIZED],
    "body": ["arm", "hand", "leg"],
    "joint": ["arm_a", "hand_b", "leg_c"],
}
PATTERNS = {  # what they match among those that can vary, by re.fullmatch, in the model's order
    "geom": ([".*"], ["arm_.*"], [".*box", "hand_ball"], ["hand_tin", "arm_rod"], [".*_.*|floor"], [None]),
    "body": ([".*"], ["leg|arm"], ["hand"], [None]),
    "joint": ([".*"], [".*_[ac]"], ["leg_c", "arm_a"], [None]),
}


def selected(attribute, patterns):
    """Names, in the model's order."""
    able = [n for n in NAMED[attribute.partition(".")[0]] if not (attribute == "geom.size" and n == "floor")]
    return [n for n in able if patterns == [None] or any(re.fullmatch(p, n) for p in patterns)]


def numbers(rng, low, high, n, axes):
    """Random numbers of a random shape: one, one an axis, or one for each element and axis, or element."""
    shapes = [(), (axes,), (n, axes)] if axes else [(), (n,)]
    return rng.uniform(low, high, shapes[rng.integers(len(shapes))])


def random_range(rng, n, axes, attribute):
    """A distribution of numbers from 0.1 to 0.9."""
    relative = [None, "scale", "add"][rng.integers(2 if attribute == "geom.rgba" else 3)]  # colours end at 1
    tied = [False, True, *(["axes", tuple(bool(b) for b in rng.integers(2, size=axes))] if axes else [])]
    kind, tie = rng.integers(5), tied[rng.integers(len(tied))]
    if kind == 0:
        return mja.Uniform(numbers(rng, 0.1, 0.4, n, axes), numbers(rng, 0.5, 0.9, n, axes), relative, tie)
    if kind == 1:
        return mja.LogUniform(numbers(rng, 0.1, 0.4, n, axes), numbers(rng, 0.5, 0.9, n, axes), relative, tie)
    if kind == 2:
        return mja.Normal(numbers(rng, 0.4, 0.6, n, axes), 0.2, 0.1, numbers(rng, 0.7, 0.9, n, axes), relative, tie)
    if kind == 3:
        rows = rng.uniform(0.1, 0.9, [(4,), (4, axes)][rng.integers(2)] if axes else (4,))
        p = [None, [0.1, 0.2, 0.3, 0.4]][rng.integers(2)]
        return mja.Choice(rows, p, relative, bool(rng.integers(2)))
    return mja.Fixed(numbers(rng, 0.1, 0.9, n, axes), relative)


def at(value, i, j, axes):
    """A number of a distribution for element i and axis j."""
    value = np.asarray(value)
    if value.ndim == 0:
        return float(value)
    if value.ndim == 1:
        return float(value[j] if axes else value[i])
    return float(value[i, j])


def key_of(key, *names):
    for name in names:
        key = jax.random.fold_in(key, zlib.crc32(name.encode()))
    return key


def standard(key, dist, axes):
    """The standard draws of one key: one number, or one an axis."""
    shape = () if not axes or isinstance(dist, mja.Choice) or dist.tied == "axes" else (axes,)
    draw = jax.random.normal if isinstance(dist, mja.Normal) else jax.random.uniform
    with jax.threefry_partitionable(True):
        return np.asarray(draw(key, shape, np.float32), float)


def drawn(dist, key, attribute, name, i, j, nominal, axes):
    """One number, by the words of docs/ranges.md."""
    shared = dist.tied[j] if isinstance(dist.tied, tuple) else dist.tied is True
    draws = standard(key_of(key, attribute, "tied" if shared else name), dist, axes)
    u = float(draws[j] if draws.ndim else draws)
    if isinstance(dist, mja.Uniform):
        value = at(dist.low, i, j, axes) * (1 - u) + at(dist.high, i, j, axes) * u
    elif isinstance(dist, mja.LogUniform):
        value = math.exp(math.log(at(dist.low, i, j, axes)) * (1 - u) + math.log(at(dist.high, i, j, axes)) * u)
    elif isinstance(dist, mja.Normal):
        value = at(dist.mean, i, j, axes) + at(dist.std, i, j, axes) * u
        value = min(max(value, at(dist.low, i, j, axes)), at(dist.high, i, j, axes))
    elif isinstance(dist, mja.Choice):
        edges = np.cumsum(dist.p if dist.p is not None else np.full(4, 0.25))
        assert np.abs(u - edges).min() > SUM_ERROR  # or rounding would choose
        row = np.asarray(dist.values)[np.searchsorted(edges, u)]
        value = float(row[j] if row.ndim else row)
    else:
        value = at(dist.at, i, j, axes)
    return {"add": nominal + value, "scale": nominal * value, None: value}[dist.relative]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.ranges.terms.geom_friction.* no effect")
@pytest.mark.parametrize("seed", range(6))
def test_as_a_plain_loop(seed):
    """Seven terms of random selections and axes, with random ranges."""
    rng, terms, ranges = np.random.default_rng(seed), {}, {}
    for attribute, axes in AXES.items():
        choices = PATTERNS[attribute.partition(".")[0]]
        patterns = list(choices[rng.integers(len(choices))])
        vary = tuple(a for a in axes if rng.random() < 0.6) or axes
        names = selected(attribute, patterns)
        terms[attribute.replace(".", "_")] = (attribute, patterns, vary, names)
        ranges[attribute.replace(".", "_")] = random_range(rng, len(names), len(axes), attribute)
    arena = mja.Arena.from_xml(XML)
    arena.vary(**{q: dr.Term(a, None if p == [None] else p, v or None) for q, (a, p, v, _) in terms.items()})
    nominal, key = arena.nominal_params().terms, mja.world_keys(seed, [7])[0]
    got = arena.sample_params(key, mja.ArenaRanges(terms=ranges)).terms
    for quantity, (attribute, _, vary, names) in terms.items():
        assert list(arena.elements(quantity)) == names, quantity
        axes, dist = AXES[attribute], ranges[quantity]
        want = np.array(nominal[quantity], float)
        for i, name in enumerate(names):
            for j in range(max(1, len(axes))):
                varies = not axes or (axes[j] in vary and (attribute != "geom.size" or j < SIZED[name]))
                where = (i, j) if axes else (i,)
                if varies:
                    want[where] = drawn(dist, key, attribute, name, i, j, want[where], len(axes))
        np.testing.assert_allclose(got[quantity], want, rtol=2e-6, atol=1e-7, err_msg=f"{quantity} {dist}")
