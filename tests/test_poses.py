"""Where the ray caster has cameras, lights and geoms: where C MuJoCo has them in the recompiled world, to what single precision leaves."""

import functools

import jax
import mujoco
import numpy as np
import pytest
from rounding import Rounding

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.pixels.poses import poses

N = 6
MODES = ("fixed", "track", "trackcom", "targetbody", "targetbodycom")


def mounted(kind, place):
    """A camera or a light of each mode, which looks at a link or at an object where it looks at something."""
    looks = {"camera": 'euler=".3 -.2 .5"', "light": 'dir=".2 .3 -1"'}[kind]
    found = []
    for k, mode in enumerate(MODES):
        target = f'target="{"lower" if place == "upper" else "upper"}"' if mode.startswith("target") else ""
        pos = f'pos=".{k + 1} -.2 .{9 - k}"'
        found.append(f'<{kind} name="{kind}_{place}_{mode}" mode="{mode}" {target} {pos} {looks}/>')
    return "".join(found)


def both(place):
    return mounted("camera", place) + mounted("light", place)


ARM = f"""<mujoco><compiler angle="radian"/><worldbody><body name="foot" pos=".1 .2 0" euler="0 0 .4">{both("foot")}
<geom name="foot" size=".05" mass="1"/>
<body name="upper" pos="0 0 .3"><joint name="shoulder" axis="0 1 0"/><geom name="upper" type="capsule" size=".03" fromto="0 0 0 .3 0 .1"/>
{both("upper")}
<body name="lower" pos=".3 0 .1" euler=".2 0 0"><joint name="elbow" axis="1 0 1"/><joint name="slide" type="slide" axis="0 1 0"/>
<geom name="lower" type="box" size=".02 .03 .15" pos="0 .02 .15"/>{both("lower")}
</body></body></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def arena():
    """An arm with all modes on a fixed body and on two moving ones, on a table that moves, beside a cube at which others look."""
    made = mja.MultiTableArena(table_offsets=[[0, 0, 0.8]], objects=[mja.Object("cube", full_size=0.1)])
    made.attach(ARM, "arm_", on=0)
    for mode in ("targetbody", "targetbodycom"):
        at = {"mode": getattr(mujoco.mjtCamLight, f"mjCAMLIGHT_{mode.upper()}"), "targetbody": "cube"}
        made.spec.worldbody.add_camera(name=f"camera_{mode}", pos=[1.5, 0.3, 1.9], **at)
        made.spec.worldbody.add_light(name=f"light_{mode}", pos=[-0.5, 0.8, 2.5], **at)
    made.vary(
        eye=dr.Term("camera.pos", "(arm_)?camera_.*"),
        gaze=dr.Term("camera.rpy", "(arm_)?camera_.*"),
        lamp=dr.Term("light.pos", "(arm_)?light_.*"),
        beam=dr.Term("light.dir", "(arm_)?light_.*"),
        links=dr.Term("body.pos", "arm_(upper|lower)"),
        masses=dr.Term("body.mass", "arm_(upper|lower)"),
    )
    return made


RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.3], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-1.0, 1.0),
    terms={
        "eye": mja.Uniform(-0.1, 0.1, relative="add"),
        "gaze": mja.Uniform(-0.3, 0.3),
        "lamp": mja.Uniform(-0.1, 0.1, relative="add"),
        "beam": mja.Uniform(-0.2, 0.2, relative="add"),
        "links": mja.Uniform(-0.05, 0.05, relative="add"),
        "masses": mja.Uniform(0.3, 3.0, relative="scale"),
    },
)


@pytest.fixture(scope="module")
def worlds(arena, impl):
    """Worlds in random states, the same on Warp, and each in C."""
    keys = mja.world_keys(0, range(N))
    batch = arena.randomize(arena.put_model(impl), keys, RANGES)
    data = mja.make_data(batch, keys)
    rng, model, qpos = np.random.default_rng(0), arena.mj_model, np.array(data.qpos, float)
    for row in qpos:
        mujoco.mj_integratePos(model, row, rng.uniform(-0.8, 0.8, model.nv), 1.0)
    data = data.replace(qpos=jax.numpy.asarray(qpos, data.qpos.dtype))
    drawn = batch if impl == "warp" else arena.batch(arena.put_model("warp"), batch.params)
    return batch, data, drawn, [arena.c_world(batch.world(i), mja.take(data, i)) for i in range(N)]


def placed(batch, data, drawn, model):
    """`Poses` of all worlds, of a model on Warp with the axes of `drawn`."""
    one = functools.partial(poses, batch.record.layout)
    return jax.vmap(one, in_axes=(0, batch.in_axes, drawn.in_axes, 0))(batch.params, batch.model, model, data)


def off(found, in_c):
    """How far poses are from C's at most, by names of their fields: 1 is where rounding may take them."""
    worst = dict.fromkeys(found._fields, 0.0)
    for i, (model, c) in enumerate(in_c):
        rounding = Rounding(model, c)
        reach = rounding.reach.max()
        for name in worst:
            want, got = getattr(c, name), np.asarray(getattr(found, name)[i], float)
            size = reach if name.endswith("pos") else 1.0
            if name in ("cam_xmat", "light_xdir"):
                size = max(1.0, reach / nearest(model, c, name.partition("_")[0]))  # a direction between two places
            far = np.abs(got.reshape(want.shape) - want).max()
            worst[name] = max(worst[name], far / (rounding.error * size))
    return worst


def nearest(model, c, kind):
    """The smallest distance [m] from a camera or a light to what it looks at."""
    aimed = (
        (mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY, c.xpos),
        (mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODYCOM, c.subtree_com),
    )
    mode, target, at = (
        getattr(model, f"{kind}_mode"),
        getattr(model, f"{kind}_targetbodyid"),
        getattr(c, f"{kind}_xpos"),
    )
    ids = ((i, there) for which, there in aimed for i in np.flatnonzero(mode == which))
    return min(np.linalg.norm(there[target[i]] - at[i]) for i, there in ids)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
@pytest.mark.slow
def test_as_in_c(worlds):
    """All modes, on fixed and moving bodies, of quantities that vary, in random states."""
    batch, data, drawn, in_c = worlds
    worst = off(jax.jit(placed)(batch, data, drawn, drawn.model), in_c)
    assert max(worst.values()) < 1, worst
    for kind in ("cam", "light"):
        model = batch.record.mj_model
        moving = getattr(model, f"{kind}_mode")[getattr(model, f"{kind}_bodyid") == model.body("arm_lower").id]
        assert sorted(moving) == list(range(len(MODES)))


STALE = {
    "cam_xpos": ("cam_pos", "cam_pos0", "cam_poscom0"),
    "cam_xmat": ("cam_quat", "cam_mat0"),
    "light_xpos": ("light_pos", "light_pos0", "light_poscom0"),
    "light_xdir": ("light_dir", "light_dir0"),
}


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_mutants_are_noticed(arena, worlds):
    """Each field of cameras and lights that stays nominal."""
    batch, data, drawn, in_c = worlds
    nominal, place = arena.put_model("warp"), jax.jit(placed)
    for seen, fields in STALE.items():
        for field in fields:
            stale = np.broadcast_to(getattr(nominal, field), getattr(drawn.model, field).shape)
            worst = off(place(batch, data, drawn, drawn.model.tree_replace({field: stale})), in_c)
            assert worst.pop(seen) > 1000, field
            assert max(worst.values()) < 1 or field in ("cam_pos", "light_pos"), field  # which move what is aimed, too
