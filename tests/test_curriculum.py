"""Ranges that widen with a level, and environments whose worlds go up and down by their success."""

import re

import documented
import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds

import mjx_arenas as mja
from mjx_arenas.params.params import QUANTITIES

envs = pytest.importorskip("mjx_arenas.envs")

N = 200
LEVELS = np.linspace(0, 1, 11, dtype=np.float32)
RANGES = {
    "Uniform": {"table_offsets": mja.Uniform([[0, 0, 0.5]], [[0.3, 0.4, 1.1]])},
    "Uniform add": {"table_offsets": mja.Uniform([-0.1, -0.2, -0.3], [0.1, 0.2, 0.4], relative="add")},
    "Uniform scale": {"object_full_sizes": mja.Uniform(0.7, 1.3, relative="scale", tied="axes")},
    "Uniform, axes tied": {"table_full_sizes": mja.Uniform(0.5, 0.9, tied="axes")},
    "Uniform, one axis": {"table_full_sizes": mja.Uniform([0.8, 0.3, 0.05], [0.8, 1.0, 0.05])},
    "LogUniform": {"table_frictions": mja.LogUniform([0.05, 0.005, 0.0001], [1.0, 0.005, 0.0001])},
    "LogUniform scale": {"object_densities": mja.LogUniform(0.3, 3.0, relative="scale")},
    "LogUniform of densities": {"object_densities": mja.LogUniform(100.0, 3000.0)},
    "LogUniform add": {"table_rots": mja.LogUniform(0.01, 1.0, relative="add")},
    "Normal": {"table_rots": mja.Normal(0.1, 0.2, -0.3, 0.3)},
    "Normal add": {"table_offsets": mja.Normal(0.0, [0.1, 0.1, 0.2], -0.3, 0.3, relative="add")},
    "Normal scale": {"object_masses": mja.Normal(1.2, 0.5, 0.5, 2.0, relative="scale")},
    "Bernoulli": {"has_legs": mja.Bernoulli(0.4)},
    "Count": {"object_active": mja.Count(1, 3)},
    "Fixed": {"table_rots": mja.Fixed(0.7)},
    "Choice scale": {"table_full_sizes": mja.Choice([0.5, 1.0, 1.1], relative="scale")},
}
UNCHANGED = {
    "Choice": {"table_rots": mja.Choice([0.3, 0.5])},
    "Fixed of truth": {"has_legs": mja.Fixed(False)},
    "Workspace": {"workspace": mja.Workspace((-1, -1), (1, 1))},
}


@pytest.fixture(scope="module")
def arena():
    return worlds.arena(1)


def drawn(arena, ranges):
    """(levels, N, ...) parameters, of the same keys at each level, and whether the arenas can be."""
    at = envs.widening(arena, ranges)

    def one(level, key):
        params = arena.sample_params(key, at(level))
        return params, arena.valid(params, at(level))

    @jax.jit
    def draw(keys):
        graded = jax.vmap(jax.vmap(one, in_axes=(None, 0)), in_axes=(0, None))(LEVELS, keys)
        return *graded, jax.vmap(lambda key: arena.sample_params(key, ranges))(keys)

    keys = jax.random.split(jax.random.key(4), N)
    params, valid, full = draw(keys)
    return *(jax.tree.map(np.asarray, tree) for tree in (params, full)), np.asarray(valid)


@pytest.mark.slow
@pytest.mark.parametrize("case", RANGES)
def test_from_nominal_to_full(arena, case):
    """Nominal at level 0, the full range's draws at level 1, within both in between, and ever wider."""
    ranges = mja.ArenaRanges(**RANGES[case])
    params, full, valid = drawn(arena, ranges)
    assert valid.all()
    nominal = arena.nominal_params()
    for name in QUANTITIES:
        x, start, end = getattr(params, name), np.asarray(getattr(nominal, name)), getattr(full, name)
        np.testing.assert_allclose(x[0], np.broadcast_to(start, x[0].shape), rtol=3e-7, atol=1e-8, err_msg=name)
        np.testing.assert_allclose(x[-1], end, rtol=1e-6, atol=1e-8, err_msg=name)
        if x.dtype != float:
            x, start, end = x.astype(float), start.astype(float), end.astype(float)
        low, high = np.minimum(start, end.min(0)), np.maximum(start, end.max(0))
        assert (x >= low - 1e-6).all(), name
        assert (x <= high + 1e-6).all(), name
        if name in ranges.varying:
            spread = x.std(1).sum(tuple(range(1, x.ndim - 1)))
            assert spread[0] < 1e-6, name
            if not case.startswith("Fixed"):
                assert (spread[5] > 1e-3 * abs(x).max()) & (spread[-1] > 0), name
    changed = [name for name in QUANTITIES if (getattr(params, name)[5] != getattr(params, name)[0]).any()]
    assert set(changed) <= ranges.varying
    assert changed


@pytest.mark.slow
@pytest.mark.parametrize("case", UNCHANGED)
def test_unchanged(arena, case):
    """What has no way from nominal is the same at every level."""
    params, full, valid = drawn(arena, mja.ArenaRanges(**UNCHANGED[case]))
    assert valid.all()
    jax.tree.map(lambda x, end: np.testing.assert_array_equal(x, np.broadcast_to(end, x.shape)), params, full)


@pytest.mark.parametrize("level", [0.0, 0.3, 1.0])
def test_bounds_within(arena, level):
    """The ranges themselves, of concrete levels, are as the library wants them, and lie within the full ones."""
    for case, given in RANGES.items():
        ranges = mja.ArenaRanges(**given)
        at = envs.widening(arena, ranges)(level)
        arena.sample_params(jax.random.key(0), at)  # complains of bad ranges
        for name, full in given.items():
            dist = getattr(at, name)
            assert (type(dist), dist.relative, dist.tied) == (type(full), full.relative, full.tied)
            if case in ("Fixed", "Choice scale"):
                continue
            nominal = {"add": 0.0, "scale": 1.0}.get(dist.relative)
            if nominal is None:
                nominal = (
                    arena.record.drawing.object_densities
                    if name == "object_densities"
                    else getattr(arena.nominal_params(), name)
                )
            nominal = np.asarray(nominal, float)
            (low, high), (full_low, full_high) = dist.support(), full.support()
            assert (low >= np.minimum(nominal, full_low) * (1 - 1e-6) - 1e-6).all(), case
            assert (high <= np.maximum(nominal, full_high) + 1e-6).all(), case


SLIDE = """
<mujoco>
  <worldbody>
    <body pos="0 0 3"><joint name="slide" type="slide" axis="1 0 0"/><geom size="0.02" contype="0" conaffinity="0"/></body>
  </worldbody>
  <actuator><velocity joint="slide" kv="1" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
FULL = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.2, -0.2, -0.2], [0.2, 0.2, 0.2], relative="add"),
    table_rots=mja.Uniform(-0.5, 0.5),
)


class AsTold(envs.ArenaEnv):
    """A task that succeeds where the action is positive."""

    def __init__(self, config_overrides=None, ranges=None):
        arena = mja.TableArena()
        arena.attach(mujoco.MjSpec.from_string(SLIDE))
        arena.spec.option.iterations, arena.spec.option.ls_iterations = 1, 6  # one is no loop, which compiles faster
        ranges = envs.widening(arena, FULL) if ranges is None else ranges
        config = envs.env_config(ctrl_dt=0.005, sim_dt=0.005, episode_length=3)
        config.level, config.level_step = 0.2, 0.1
        super().__init__(arena, ranges, config, config_overrides)

    def draw_task(self, key, params, qpos):
        return {}

    def observe(self, data, episode):
        return {"state": data.qpos, "privileged_state": data.qpos}

    def score(self, data, episode, action):
        success = (action[0] > 0).astype(jnp.float32)
        return success, jnp.zeros((), bool), {"success": success}


@pytest.mark.slow
def test_levels_follow_success():
    """Of each world alone, up and down, within 0 and 1; the arenas follow; nothing is compiled anew."""
    env, n, length, episodes = AsTold(), 4, 3, 13
    traces = 0

    @jax.jit
    def step(state, action):
        nonlocal traces
        traces += 1
        return jax.vmap(env.step)(state, action)

    # One that always fails, one that always succeeds, one in turns, one that fails after success.
    succeeds = np.array([[0, 1, i % 2, i < 6] for i in range(episodes)], bool)
    state = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), n))
    level = np.full(n, 0.2)
    levels, offsets, rots = [], [], []
    for wanted in succeeds:
        for i in range(length):
            # What decides is the last step of an episode.
            state = step(state, jnp.where(wanted if i == length - 1 else ~wanted, 1.0, -1.0)[:, None])
            np.testing.assert_allclose(state.info["level"], level, atol=1e-6)
        levels.append(level)
        offsets.append(
            np.asarray(state.info["episode"].params.table_offsets)[:, 0] - env.arena.nominal_params().table_offsets[0]
        )
        rots.append(np.asarray(state.info["episode"].params.table_rots)[:, 0])
        level = np.clip(level + np.where(wanted, 0.1, -0.1), 0, 1)
        state = state.replace(done=jnp.ones(n))
    assert traces == step._cache_size() == 1
    levels, offsets, rots = np.array(levels), abs(np.array(offsets)), abs(np.array(rots))
    assert levels[-1].round(6).tolist() == [0, 1, 0.2, 0.2]
    assert not state.metrics["invalid_arena"].any()
    # An arena is of the level of the episode before, in which it was drawn.
    drawn_at = np.concatenate([levels[:1], levels[:-1]])
    assert (offsets <= 0.2 * drawn_at[..., None] + 1e-6).all()
    assert (rots <= 0.5 * drawn_at + 1e-6).all()
    assert offsets[4:, 0].max() < 1e-6
    assert rots[4:, 0].max() < 1e-6
    assert offsets[9:, 1].max() > 0.1
    assert len(np.unique(rots[:, 1])) == episodes


def test_bad_ranges():
    """Those of the last level, too, when the environment is made."""
    with pytest.raises(ValueError, match=r"`ranges\.table_rots`"):
        AsTold(ranges=lambda level: mja.ArenaRanges(table_rots=mja.Uniform(level, 0.5)))
    with pytest.raises(ValueError, match=r"^`ranges` must name the same quantities at every level\.$"):
        AsTold(ranges=lambda level: FULL if level else mja.ArenaRanges())


@pytest.mark.xslow
@pytest.mark.slow
def test_documented(monkeypatch, capsys):
    """The code of docs/training.md on new arenas and on curricula, with a small environment in the place of Push."""
    docs = documented.section("A new arena in every episode")
    new_arenas, (curriculum,) = documented.blocks("A new arena in every episode"), documented.blocks("Curriculum")
    assert len(new_arenas) == 2
    monkeypatch.setattr(envs, "Push", AsTold)
    wrapper = pytest.importorskip("mujoco_playground").wrapper
    names = {"jax": jax, "wrapper": wrapper, "keys": jax.random.split(jax.random.key(0), 4), "ranges": FULL}
    documented.run("".join(new_arenas), names)
    first, state = names["env"], names["state"]
    assert names["train_env"].unwrapped is first
    assert set(state.info) == set(re.findall(r"`(\w+)`", docs[docs.index("`state.info` has") :])) & set(state.info)
    reports = re.findall(r"^\| `(\w+)` \|", docs[docs.index("`state.metrics` has") :], flags=re.MULTILINE)
    told = {name: float(state.metrics[name].max()) for name in reports}
    assert told == dict.fromkeys(reports, 0.0) | {"success_at_end": 1.0}  # the block ends with an episode's last step
    assert set(state.metrics) == {"success", *reports}
    documented.run(curriculum, names)
    assert names["env"] is not first
    np.testing.assert_allclose(names["state"].info["level"], 0.4, atol=1e-6)  # 0.2, up twice
    assert "0.4" in capsys.readouterr().out
