"""Where two boxes touch on Warp and in C MuJoCo, with MuJoCo's native collisions and without, as docs/arms.md says."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

pytest.importorskip("mujoco_playground")

from models import ROBOTS
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import envs
from mjx_arenas.envs import Lift, PickAndPlace

POSES, ROOM = 40, 16  # poses; contacts of one pose
FLAT, TILTED = (0.005, 5e-4), (0.12, 5e-3)  # how far the upper box is tilted [rad], and how deep it is in the lower [m]
ROUNDED = 8 * 2.0**-23  # a few roundings of numbers up to 1
HALF = 0.03, 0.02  # [m]
CUBES = """<mujoco><worldbody><geom type="box" size="{0} {0} {0}"/>
<body pos="0 0 1"><freejoint/><geom type="box" size="{1} {1} {1}" mass=".1"/></body></worldbody></mujoco>""".format(
    *HALF
)


def poses(tilt, sunk):
    """(n, 7) of the upper box: on the lower or over its edge, turned about the vertical and tilted."""
    numbers = np.random.default_rng(0)
    turns = numbers.normal(size=(POSES, 3)) * (tilt, tilt, 0.5)
    pos = np.column_stack([numbers.uniform(-0.03, 0.03, (POSES, 2)), np.full(POSES, sum(HALF) - sunk)])
    quat = np.column_stack([np.ones(POSES), turns / 2])
    return np.column_stack([pos, quat / np.linalg.norm(quat, axis=1, keepdims=True)]).astype(np.float32)


def found(native, stands):
    """Contacts of each pose, on Warp and in C: rows of position, depth and normal."""
    arena = mja.Arena.from_xml(CUBES)
    if not native:
        arena.spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    model, at = arena.put_model("warp"), poses(*stands)
    data = mjx.make_data(arena.mj_model, impl="warp", naconmax=POSES * ROOM, njmax=ROOM * 4)
    stepped = jax.jit(jax.vmap(lambda qpos: mjx.forward(model, data.replace(qpos=qpos))))(jnp.asarray(at))
    got = stepped._impl
    worlds = np.array(got.contact__worldid)[: int(np.max(got.nacon))]
    rows = np.column_stack([got.contact__pos, got.contact__dist, np.reshape(got.contact__frame, (-1, 9))[:, :3]])
    on_warp = [rows[: len(worlds)][worlds == w] for w in range(POSES)]
    return on_warp, [in_c(arena.mj_model, one) for one in at]


def in_c(model, qpos):
    c = mujoco.MjData(model)
    c.qpos[:] = qpos
    mujoco.mj_forward(model, c)
    return np.column_stack([c.contact.pos, c.contact.dist, c.contact.frame[:, :3]])


def alike(ours, theirs):
    """Whether the same contacts are among both, in any order."""
    apart = np.abs(ours[:, None] - theirs[None]).max(-1)
    return len(ours) == len(theirs) and max(*apart.min(0), *apart.min(1)) < ROUNDED


@pytest.mark.slow
@pytest.mark.parametrize(("stands", "differ"), [(FLAT, (4, 1)), (TILTED, (2, 4))], ids=["flat", "tilted"])
def test_boxes_in_c(stands, differ):
    """Without the native collisions Warp finds C's contacts; with them it finds four at most, also where C finds one or more than four.

    Of a box that stands tilted, as a finger that presses on a table, it finds two where C finds four.
    """
    on_warp, c = found(native=False, stands=stands)
    assert all(map(alike, on_warp, c))
    on_warp, again = found(native=True, stands=stands)
    np.testing.assert_array_equal(np.concatenate(again), np.concatenate(c))  # C has no native collisions of boxes
    counts = [(len(ours), len(theirs)) for ours, theirs in zip(on_warp, c, strict=True)]
    assert max(ours for ours, _ in counts) <= 4 < max(theirs for _, theirs in counts)
    assert differ in counts


@pytest.mark.parametrize(
    ("task", "arm"), [(Lift, "small"), (PickAndPlace, "small"), (PickAndPlace, "yam"), (Lift, "panda")]
)
def test_tasks_have_them(task, arm, monkeypatch):
    """Tasks whose arms hold boxes have C's contacts of them, whatever the options of the arm are."""
    monkeypatch.syspath_prepend(ROBOTS)
    model = task(arm=getattr(envs.arms, arm)()).mj_model
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_NATIVECCD
