"""`check_randomization` of this library's own arenas and environments: nothing is wrong, but what is written over."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import worlds
from test_preflight import batched, worlds_keys

import mjx_arenas as mja

pytestmark = pytest.mark.slow_on("warp")


def test_range_without_width(arena):
    """What is batched and does not vary is noted."""
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1), table_frictions=mja.Uniform(0.3, 0.3))
    model_v, in_axes = arena.randomization_fn(ranges)(arena.put_model("jax"), rng=worlds_keys())
    report = mja.check_randomization(arena.put_model("jax"), model_v, in_axes)
    assert report.ok
    assert report.notes == ("`geom_friction` is batched, but the same in all worlds.",)


@pytest.mark.slow
def test_environment_with_arenas_of_its_own():
    """What it writes over is a problem, or, where some of it stays, a note; its own robot's is left alone."""
    Slide = pytest.importorskip("sliding").Slide
    env = Slide(
        ranges=mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 0.5), table_frictions=mja.Uniform(0.3, [1.0, 0.3, 0.3]))
    )
    randomize = env.arena.randomization_fn(mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)))
    randomized = randomize(env.mjx_model, rng=worlds_keys())
    problems = mja.check_randomization(env.mjx_model, *randomized, env).problems
    (sentence,) = [p for p in problems if "`env`" in p]
    assert {"body_quat", "qpos0"} <= set(re.findall(r"`(\w+)`", sentence))
    assert sentence.endswith("have no effect: `env` draws arenas of its own and writes them itself.")
    assert mja.check_randomization(env.mjx_model, *randomized).ok

    def check(change):
        return mja.check_randomization(env.mjx_model, *batched(env.mjx_model, geom_friction=change), env)

    slab, robot = (
        env.arena.layout.table_geom[0, 0],
        env.mj_model.body_geomadr[env.mj_model.joint("robot_slide").bodyid[0]],
    )
    assert check(lambda f, i: f.at[slab, 0].add(0.1 * i)).problems == (
        "`geom_friction` has no effect: `env` draws arenas of its own and writes it itself.",
    )
    both = check(lambda f, i: f.at[jnp.array([slab, robot]), 0].add(0.1 * i))
    assert both.ok
    assert both.notes[-1].startswith("`geom_friction` has an effect in part: `env` draws arenas of its own and writes")
    alone = check(lambda f, i: f.at[robot, 0].add(0.1 * i))
    assert not [sentence for sentence in (*alone.problems, *alone.notes) if "`env`" in sentence]


def test_environment_that_caches(arena):
    """An environment that keeps what it read from the model in its constructor is named, with the field."""
    model = arena.put_model("jax")
    randomized = arena.randomization_fn(mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)))(model, rng=worlds_keys())

    class Env:
        def __init__(self, start):
            self._mjx_model, self.start, self.limits = model, start, jnp.array([0.0, 1.0])

    assert not [n for n in mja.check_randomization(model, *randomized, Env(jnp.arange(3.0))).notes if "env." in n]
    for start, name in ((model.qpos0, "qpos0"), ({"quat": np.asarray(model.body_quat)[1]}, "body_quat")):
        (note,) = [n for n in mja.check_randomization(model, *randomized, Env(start)).notes if "env." in n]
        assert note == (
            f"`env.start` holds numbers of the template's `{name}`, which varies: if `reset` or `step` use them, they "
            f"must read `self._mjx_model.{name}` there instead."
        )


OURS = {
    "everything": worlds.RANGES,
    "presence": mja.ArenaRanges(
        table_active=mja.Bernoulli([1.0, 0.5, 0.5]),
        object_active=mja.Bernoulli(0.7),
        object_tables=mja.Choice([0, 1, 2]),
        workspace=mja.Workspace((-3, -3), (3, 3), gap=0.1),
        table_offsets=mja.Uniform([0, 0, -0.2], [0, 0, 0.2], relative="add"),
    ),
    "legs": mja.ArenaRanges(has_legs=mja.Bernoulli(0.5)),
    "objects": mja.ArenaRanges(
        object_full_sizes=mja.Uniform(0.8, 1.2, relative="scale", tied="axes"),
        object_masses=mja.LogUniform(0.1, 1.0),
        object_rgba=mja.Uniform(0.0, 1.0),
    ),
    "frictions": mja.ArenaRanges(table_frictions=mja.LogUniform([0.2, 0.005, 0.0001], [1, 0.005, 0.0001])),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OURS)
def test_arenas_are_right(arena, impl, name):
    """Every field that this library writes, with each kind of range; the note of Warp is there when tables move."""
    model = arena.put_model(impl)
    for seed in range(2):
        batch = arena.randomize(model, jax.random.split(jax.random.key(seed), 16), OURS[name])
        report = mja.check_randomization(model, batch.model, batch.in_axes)
        assert report.ok, report
        assert report.n_worlds == 16
        assert set(report.varies) <= set(batch.fields)
        moves = impl == "warp" and name in ("everything", "presence", "legs")
        assert any("place_static" in note for note in report.notes) == moves
        derived = (
            r"`(body_quat|stat\.center)`.* the same in all worlds\.$"  # need not follow what they are derived from
        )
        assert all(re.search(f"place_static|distinct|{derived}", note) for note in report.notes), report
