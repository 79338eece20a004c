"""JAX's strict modes, with which users find promotions and transfers of their own: ours and MJX's do not stand in the way."""

import functools
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import strict
from mjx_arenas.sample import packing

N = 2
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([0, 0, -0.1], [0, 0, 0.1], relative="add", tied=(False, False, True)),
    table_rots=mja.Choice([-0.5, 0.5], p=[0.3, 0.7]),
    table_frictions=mja.LogUniform([0.2, 0.005, 0.0001], [1.0, 0.005, 0.0001]),
    table_active=mja.Bernoulli([1, 0.5]),
    object_active=mja.Count(1, 2),
    object_tables=mja.Choice([0, 1]),
    object_full_sizes=mja.Uniform([0.9, 0.9, 0.9], [1.1, 1.1, 1.1], relative="scale", tied="axes"),
    object_rgba=mja.Normal([0.5, 0.5, 0.5, 1], [0.1, 0.1, 0.1, 0], [0, 0, 0, 1], [1, 1, 1, 1]),
    workspace=mja.Workspace(low=(-3, -3), high=(3, 3), gap=0.2),
)


@functools.cache
def the_arena():
    """Two tables that are there in some worlds, with a ball each."""
    objects = [mja.Object("ball", "sphere", 0.06), mja.Object("other", "sphere", 0.05, on=1)]
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], objects=objects)
    arena.spec.option.iterations = arena.spec.option.ls_iterations = 1
    return arena


@functools.cache
def made(impl):
    """A batch and its data, a model and the parameters of one world, and keys."""
    arena = the_arena()
    keys = jax.random.split(jax.random.key(0), N)
    model = arena.put_model(impl)
    batch = arena.randomize(model, keys, RANGES)
    return batch, mja.make_data(batch, keys), model, arena.sample_params(keys[0], RANGES), keys


def calls(impl):
    """What users call, by name."""
    batch, data, model, params, keys = made(impl)
    arena, world, key = the_arena(), arena_model(impl), keys[0]
    return {
        "sample_params": lambda: arena.sample_params(key, RANGES),
        "nominal_params": arena.nominal_params,
        "valid": lambda: arena.valid(params, RANGES),
        "randomize": lambda: arena.randomize(model, keys, RANGES),
        "randomization_fn": lambda: arena.randomization_fn(RANGES)(model, keys),
        "batch": lambda: arena.batch(model, batch.params),
        "apply": lambda: arena.apply(model, params),
        "place": lambda: arena.place(params, key),
        "place with a margin": lambda: arena.place(params, key, 0.01),
        "rest_heights": lambda: arena.rest_heights(params),
        "make_data": lambda: mja.make_data(batch, keys),
        "make_world_data": lambda: arena.make_world_data(world, params, key),
        "place_static": lambda: jax.vmap(mja.place_static, in_axes=(batch.in_axes, 0))(batch.model, data),
        "step": lambda: mja.step(batch, data),
        "rollout": lambda: mja.rollout(batch, data, 2, control=np.zeros((2, 0), np.float32)),
        "capacity": lambda: mja.capacity(batch, data),
        "take": lambda: mja.take(data, 1),
        "world": lambda: batch.world(1),
        "world_keys": lambda: mja.world_keys(0, [1, 2]),
    }


@functools.cache
def arena_model(impl):
    _, _, model, params, _ = made(impl)
    return the_arena().apply(model, params)


@pytest.mark.slow
def test_no_transfers():
    """Once they are compiled, under `transfer_guard("disallow")`: what of ours goes to the device does so on purpose."""
    all_calls = calls("jax")
    for call in all_calls.values():
        jax.block_until_ready(call())
    with jax.transfer_guard("disallow"):
        for name, call in all_calls.items():
            try:
                jax.block_until_ready(call())
            except Exception as error:
                raise AssertionError(name) from error
        with pytest.raises(Exception, match="transfer"):  # a user's own are found
            jnp.ones(3) + np.ones(3)


@pytest.mark.slow
def test_no_promotions():
    """Traced anew under `numpy_rank_promotion("raise")`: ours promote nothing, and MJX's own promotions are let pass."""
    all_calls = calls("jax")
    jax.clear_caches()  # what is traced already promotes nothing any more
    with jax.numpy_rank_promotion("raise"):
        for name, call in all_calls.items():
            try:
                jax.block_until_ready(call())
            except Exception as error:
                raise AssertionError(name) from error
        with pytest.raises(ValueError, match="promotion"):  # a user's own are found
            jnp.ones(3) + jnp.ones((2, 3))


def test_placing_promotes_nothing():
    """Nor does the search for free places, of given yaws and of drawn ones."""
    solids = packing.Solids(
        jnp.zeros((2, 3)), jnp.full((2, 2), 0.05), jnp.zeros(2), jnp.zeros(2), jnp.ones(2), jnp.ones(2, bool)
    )
    regions = packing.Region(jnp.zeros((2, 3)), jnp.full((2, 2), 0.5))
    keys, ignore = jax.random.split(jax.random.key(0), 2), jnp.zeros((2, 2), bool)
    with jax.numpy_rank_promotion("raise"):
        for rots in (None, jnp.zeros((2, 2)), jnp.array([[-0.2, 0.2], [-4.0, 4.0]])):
            pose, found = jax.jit(packing.pack)(keys, solids, regions, solids, ignore, rots)
            assert found.all()
            inside, apart = jax.jit(packing.in_place)(solids._replace(pose=pose), regions)
            assert inside.all()
            assert apart.all()


@pytest.mark.slow
@pytest.mark.parametrize("example", ["kitchen", "bin_picking"])
def test_furniture_promotes_nothing(example):
    """Nor do parts, what stands on them or falls into them, inertials of geoms that vary, and worlds as points of a cube."""
    arena, ranges = mja.load(example)
    model, key = arena.put_model("jax"), jax.random.key(0)
    with jax.numpy_rank_promotion("raise"):
        params = arena.sample_params(key, ranges)
        arena.valid(params, ranges)
        arena.place(params, key)
        arena.apply(model, params)
        arena.decode(arena.encode(params, ranges), ranges)


SWITCHED = r"^`jax_enable_x64` was switched after arenas had been used: set it when the program starts, or call jax\.clear_caches\(\) and "


def test_precision_that_was_switched(monkeypatch):
    """JAX's errors of types that do not fit are answered by the reason, where it was; any other error stays."""

    def call(error):
        with strict.one_precision():
            raise error

    mixed = TypeError("lax.add requires arguments to have the same dtypes, got int32, int64.")
    with pytest.raises(TypeError, match=r"^lax\.add"):
        call(mixed)
    monkeypatch.setattr(strict, "_FIRST", [True])
    with pytest.raises(RuntimeError, match=SWITCHED):
        call(mixed)
    with pytest.raises(ValueError, match=r"^got shape \(64, 3\)\.$"):
        call(ValueError("got shape (64, 3)."))


@pytest.mark.slow
def test_data_of_another_precision():
    """Of a rollout, whose steps would give data of other types."""
    arena, keys = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)]), mja.world_keys(0, range(N))
    batch = arena.batch(arena.put_model("jax"), jax.tree.map(lambda x: jnp.stack([x] * N), arena.nominal_params()))
    data = mja.make_data(batch, keys)
    with pytest.raises(
        ValueError, match=r"^`data` must be float32, as `jax_enable_x64` says now, got float16: make the "
    ):
        mja.rollout(batch, data.replace(qpos=data.qpos.astype(jnp.float16)), 2)


LATE = """
import jax
import mjx_arenas as mja

arena = mja.TableArena()
ranges = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
keys = mja.world_keys(0, range(2))
arena.randomize(arena.put_model("jax"), keys, ranges)
jax.config.update("jax_enable_x64", True)
try:
    arena.randomize(arena.put_model("jax"), keys, ranges)
except RuntimeError as error:
    print(error)
jax.clear_caches()
print(arena.randomize(arena.put_model("jax"), keys, ranges).model.body_quat.dtype)
"""


@pytest.mark.slow
def test_late_precision():
    """In a process of its own, as JAX keeps what it made before."""
    run = [sys.executable, "-c", LATE]
    said = subprocess.run(run, env={**os.environ, "JAX_PLATFORMS": "cpu"}, check=True, capture_output=True, text=True)
    *answer, kind = said.stdout.strip().splitlines()
    assert kind == "float64"
    assert len(answer) <= 1  # none where JAX takes its constants anew
    assert all("`jax_enable_x64` was switched after arenas had been used" in line for line in answer)
