"""Arms of other packages, simplified: masses, motion and worlds of arenas with them (tests/robots.txt)."""

import functools
import pathlib
import re
import sys
import warnings

import jax
import models
import mujoco
import numpy as np
import pytest
import worlds
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

import mjx_arenas as mja

pytestmark = pytest.mark.slow

MADE = {  # how each is simplified, and pairs before and after
    "panda": ({"collision": {"link0": "hull", ".*": "primitive"}, "keep": ".*_pad.*", "visual": False}, 230, None),
    "ur5e": ({"self_collisions": False, "visual": False}, 21, 0),
    "ur5e_2f85": ({"collision": "capsule", "keep": ".*_pad.*", "self_collisions": False}, 203, 4),
    "yam": ({"collision": {"[lr]f_(rot.|down([1-3]|[6-9]|1.))_collision": "none"}}, 420, None),
    "xarm7": ({"collision": "box", "keep": "(left|right)_finger", "visual": False}, 75, None),
}
SAME = (
    "body_mass",
    "body_inertia",
    "body_ipos",
    "body_iquat",
    "body_subtreemass",
    "body_invweight0",
    "dof_M0",
    "qpos0",
)


@functools.cache
def loaded(name):
    """The arm of its package, which is not imported."""
    before, sys.path = sys.path, [*sys.path, str(models.ROBOTS)]
    try:
        spec = mja.robots.load(name)
    finally:
        sys.path = before
    assert mja.robots.known()[name].package not in sys.modules
    return spec


def made(name, **kwargs):
    return mja.simplify(loaded(name), **{**MADE[name][0], **kwargs})


def test_all_known_are_here():
    assert MADE.keys() == mja.robots.known().keys()


@pytest.mark.parametrize("name", MADE)
def test_simplified(name):
    """Names, masses and inertias are the arm's, and so is its motion where nothing touches; there are fewer pairs, or as many."""
    before = loaded(name).copy().compile()
    spec, report = made(name, options={}, measure=True)
    assert all(speed > 100 for speed in report.speeds)  # even on a machine that is busy
    after = spec.compile()
    for field in SAME:
        np.testing.assert_allclose(getattr(after, field), getattr(before, field), rtol=1e-6, atol=1e-12, err_msg=field)
    for kind, count in (
        ("body", "nbody"),
        ("joint", "njnt"),
        ("actuator", "nu"),
        ("sensor", "nsensor"),
        ("key", "nkey"),
    ):
        names = [[getattr(m, kind)(i).name for i in range(getattr(m, count))] for m in (before, after)]
        assert names[0] == names[1]
    ends = []
    for model in (before, after):
        data, model.opt.disableflags = (
            mujoco.MjData(model),
            model.opt.disableflags | mujoco.mjtDisableBit.mjDSBL_CONTACT,
        )
        mujoco.mj_step(model, data, 50)
        ends.append(data.qpos.copy())
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-6)
    assert report.before.pairs == MADE[name][1]
    assert report.after.pairs <= MADE[name][1] if MADE[name][2] is None else report.after.pairs == MADE[name][2]
    assert report.after.vertices <= report.before.vertices
    assert report.largest_change < 0.05


def test_documented(monkeypatch, capsys):
    """The code of docs/robots.md runs, and says what is there."""
    monkeypatch.setattr("sys.path", [*sys.path, str(models.ROBOTS)])
    text = (pathlib.Path(__file__).parents[1] / "docs" / "robots.md").read_text()
    (block,), (said,) = (re.findall(rf"```{kind}\n(.*?)```", text, flags=re.DOTALL) for kind in ("python", "text"))
    names = {}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "`robot`: geoms are inside each other")
        exec(compile(block, "docs/robots.md", "exec"), names)
    assert capsys.readouterr().out == said
    assert names["arena"].mj_model.key("arm_home").qpos.shape == (15 + 7,)


FAST = ("ur5e", "yam")  # the others take twice to six times as long


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.xslow] * (name not in FAST)) for name in MADE])
def test_oracle(name):
    """An arena with it is what MuJoCo compiles, in every world, leaf by leaf."""
    arena = mja.TableArena(objects=[mja.Object("cube", pos=(0.3, 0.3))])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "`robot`: geoms are inside each other")  # the Panda and the YAM at `qpos0`
        warnings.filterwarnings("ignore", "`robot` changes options of the whole arena")
        arena.attach(made(name)[0], "r_", pos=(-0.2, 0.05, 0.01), quat=(0.9, 0, 0, 0.2), on=0)
    model = arena.put_model("warp")
    ranges = mja.ArenaRanges(table_offsets=worlds.RANGES.table_offsets, table_rots=worlds.RANGES.table_rots)
    for key in jax.random.split(jax.random.key(5), 2):
        params = arena.sample_params(key, ranges)
        assert from_compiled(arena.apply(model, params), arena.compile(params)) <= STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.parametrize(
    "name", ["ur5e", *(pytest.param(name, marks=pytest.mark.xslow) for name in MADE if name != "ur5e")]
)
def test_saved(name, tmp_path):
    """An arena with a simplified arm comes back from its file, with the meshes: MuJoCo compiles the same, to rounding."""
    arena = mja.TableArena()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arena.attach(made(name)[0], on=0)
        mja.save(tmp_path / "arena.yaml", arena)
        again, _ = mja.load(tmp_path / "arena.yaml")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["arena.yaml", "arena_given0"]
    one, other = arena.mj_model, again.mj_model
    assert one.names == other.names
    for field in (*SAME, "geom_size", "geom_pos", "mesh_vert", "actuator_gainprm", "jnt_range", "opt_timestep"):
        a, b = (getattr(m, field) if hasattr(m, field) else np.float64(m.opt.timestep) for m in (one, other))
        np.testing.assert_allclose(b, a, rtol=1e-12, atol=1e-12 * np.abs(a).max(initial=0), err_msg=field)
