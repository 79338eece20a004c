"""The whole arm, the object and the goal are in the pictures of an environment, by default."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from gl import needs_gl
from idle import Idle
from models import ROBOTS

import mjx_arenas as mja
from mjx_arenas import envs
from mjx_arenas.sim.data import blank

GEOM = mujoco.mjtObj.mjOBJ_GEOM
CORNERS = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T


@pytest.mark.slow
@needs_gl
@pytest.mark.parametrize(
    ("task", "arm"),
    [
        (envs.Reach, "small"),
        pytest.param(envs.Lift, "yam", marks=pytest.mark.slow),
        pytest.param(envs.Reach, "panda", marks=pytest.mark.slow),
        pytest.param(envs.OpenDrawer, "panda", marks=pytest.mark.xslow),
    ],
)
def test_all_of_an_arm_is_seen(task, arm, monkeypatch):
    """With a table 30 cm higher or lower, in every state of an episode in which the arm turns about and rises."""
    monkeypatch.syspath_prepend(ROBOTS)
    env = task(arm=getattr(envs.arms, arm)(), config_overrides={"impl": "jax"})
    model, params = env.mj_model, env.arena.nominal_params()
    turned = jnp.array(env.arena.make_world_data(env.mjx_model, params, jax.random.key(0), None, env.keyframe).qpos)
    turned = [turned, *(turned.at[model.joint(name).qposadr[0]].add(-0.6) for name in env.arm_joints[:2])]
    for lower in (-0.3, 0.3):
        moved = params._replace(table_offsets=params.table_offsets + jnp.array([0, 0, lower]))
        data = blank(model)
        goal = moved.table_offsets[0] + jnp.array([0.1, 0.1, 0.3])
        data = data.replace(mocap_pos=jnp.tile(goal, (model.nmocap, 1)))
        info, seen = {"episode": SimpleNamespace(params=moved)}, []
        states = [SimpleNamespace(data=data.replace(qpos=qpos), info=info) for qpos in turned]

        def look(scene, seen=seen):
            camera = scene.camera[0]
            bodies = ["arm_", *(["goal"] if model.nmocap else []), *(o.name for o in env.arena.objects)]
            for geom in (scene.geoms[i] for i in range(scene.ngeom)):
                name = model.body(model.geom_bodyid[geom.objid]).name if geom.objtype == GEOM else ""
                if name.startswith(tuple(bodies)):
                    box = model.geom_aabb[geom.objid]
                    away = geom.pos + (box[:3] + CORNERS * box[3:]) @ geom.mat.T - camera.pos
                    right = np.cross(camera.forward, camera.up)
                    across = away @ np.stack([right * 3 / 4, camera.up], axis=1)
                    depth = (away @ camera.forward)[:, None]
                    seen.extend(across / depth * camera.frustum_near / camera.frustum_top)

        env.render(states, modify_scene_fns=[look] * len(states))
        assert len(seen) > 3 * len(CORNERS) * len(env.arm_joints)
        assert np.abs(seen).max() < 1
        assert np.ptp(seen, axis=0).max() > 0.5  # and they are large


RAIL = """<mujoco><worldbody>
  <geom name="rail" type="box" size="2 0.05 0.05"/><site name="goal" pos="1.8 0 0.2"/>
  <body name="cart" pos="0 0 0.1"><joint type="slide" axis="1 0 0"/><geom type="box" size="0.1 0.05 0.05"/></body>
</worldbody></mujoco>"""


def cameras(env, qpos, **changed):
    """Where the camera of each of the pictures of some states is, drawn together, and how far from the free one."""
    params = env.arena.nominal_params()._replace(**{name: jnp.array(value) for name, value in changed.items()})
    info, data, seen = {"episode": SimpleNamespace(params=params)}, blank(env.mj_model), []
    states = [SimpleNamespace(data=data.replace(qpos=jnp.array(row)), info=info) for row in qpos]
    look = [lambda scene: seen.append(np.array([scene.camera[0].pos, scene.camera[0].forward]))] * len(states)
    env.render(states, modify_scene_fns=look)
    env.render(states, modify_scene_fns=look, camera=-1)
    return np.split(np.array(seen), 2)


@needs_gl
def test_nothing_stands():
    """MuJoCo's free camera sees scenes with neither tables nor furniture, or whose table is absent, wherever what moves is."""
    rail = Idle(mja.Arena.from_xml(RAIL), mja.ArenaRanges())
    chosen, free = cameras(rail, [[0.0], [500.0]])
    np.testing.assert_array_equal(chosen, free)
    arena = mja.TableArena()
    arena.attach(mujoco.MjSpec.from_string(RAIL))
    there = [
        np.abs(np.subtract(*cameras(Idle(arena, mja.ArenaRanges()), [[0.0]], table_active=[is_there]))).max()
        for is_there in (True, False)
    ]
    assert there[0] > 0.1
    assert there[1] == 0


@needs_gl
def test_what_is_far_away_is_left_out():
    """An object that flies off a table leaves the camera where the table and what is near it are seen from."""
    env = Idle(mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)]), mja.ArenaRanges())
    near = np.array(env.mj_model.qpos0)
    far, up = near + 500 * (np.arange(7) == 0), near + 0.5 * (np.arange(7) == 2)
    alone, free = cameras(env, [near])
    assert np.abs(alone - free).max() > 0.1
    np.testing.assert_array_equal(cameras(env, [near, far])[0], alone.repeat(2, axis=0))
    assert np.abs(cameras(env, [near, up])[0] - alone).max() > 0.05


@needs_gl
def test_each_arena_is_compiled_once(monkeypatch):
    compiled, env = [], Idle(mja.TableArena(), mja.ArenaRanges())
    c_world = type(env.arena).c_world
    monkeypatch.setattr(type(env.arena), "c_world", lambda *given: compiled.append(given) or c_world(*given))
    params, data = env.arena.nominal_params(), blank(env.mj_model)
    higher = params._replace(table_offsets=params.table_offsets + 0.1)
    env.render(
        [SimpleNamespace(data=data, info={"episode": SimpleNamespace(params=p)}) for p in (params, params, higher)]
    )
    assert len(compiled) == 2
