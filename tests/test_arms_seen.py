"""The whole arm, the object and the goal are in the pictures of an environment, by default."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from gl import needs_gl
from models import ROBOTS

from mjx_arenas import envs
from mjx_arenas.sim.data import blank

GEOM = mujoco.mjtObj.mjOBJ_GEOM
CORNERS = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T


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
