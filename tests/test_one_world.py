"""What `Renderer.of_world` is given, and is not one world of its arena: a sentence each."""

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja


def one_world(arena):
    """A model, parameters and data, for `Renderer.of_world`."""
    params = arena.nominal_params()
    model = arena.apply(arena.put_model("jax"), params)
    return model, params, jax.jit(arena.make_world_data)(model, params)


@pytest.fixture(scope="module")
def small():
    return mja.TableArena(objects=[mja.Object("cube")])


@pytest.fixture(scope="module")
def ones(small):
    """One world of `small`, and of an arena with another object."""
    return one_world(small), one_world(mja.TableArena(objects=[mja.Object("cube"), mja.Object("ball", "sphere", 0.1)]))


def many(tree):
    return jax.tree.map(lambda x: np.broadcast_to(x, (3, *np.shape(x))), tree)


OF_ONE = {
    "a model of C": (
        lambda one, other: (mujoco.MjModel.from_xml_string("<mujoco/>"), *one[1:]),
        "`model`, `params` and `data` must be an mjx.Model, ArenaParams and mjx.Data, got MjModel, ArenaParams, Data.",
    ),
    "no parameters": (
        lambda one, other: (one[0], None, one[2]),
        "`model`, `params` and `data` must be an mjx.Model, ArenaParams and mjx.Data, got Model, NoneType, Data.",
    ),
    "another order": (
        lambda one, other: (one[0], one[2], one[1]),
        "`model`, `params` and `data` must be an mjx.Model, ArenaParams and mjx.Data, got Model, Data, ArenaParams.",
    ),
    "models": (
        lambda one, other: (one[0].replace(cam_fovy=many(one[0].cam_fovy)), *one[1:]),
        "`model` must be of one world, got one whose `cam_fovy` is of many: use jax.vmap with in_axes=(batch.in_axes, 0, 0).",
    ),
    "parameters": (
        lambda one, other: (one[0], many(one[1]), one[2]),
        "`params` must be of one world, got 3 worlds: take one, batch.world(i), or use jax.vmap.",
    ),
    "states": (
        lambda one, other: (*one[:2], many(one[2])),
        "`data` must be of one world, got `qpos` of shape (3, 7): take one, mja.take(data, i), or use jax.vmap.",
    ),
    "another arena's model": (
        lambda one, other: (other[0], *one[1:]),
        (
            "`model` must come from this arena's put_model() (nbody 3, ngeom 8, nsite 1, nq 7, nv 6), got the model of "
            "another arena (nbody 4, ngeom 9, nsite 1, nq 14, nv 12)."
        ),
    ),
    "another arena's parameters": (
        lambda one, other: (one[0], other[1], one[2]),
        "6 problems in `params`:\n- `params.object_full_sizes` must have shape (1, 3), got (2, 3).",
    ),
    "another arena's state": (
        lambda one, other: (*one[:2], other[2]),
        "`data.qpos` must have shape (7,), got (14,).",
    ),
    "another arena's geoms": (
        lambda one, other: (*one[:2], one[2].replace(geom_xpos=other[2].geom_xpos)),
        "`data.geom_xpos` must have shape (8, 3), got (9, 3).",
    ),
}


@pytest.mark.parametrize("case", OF_ONE)
def test_wrong_uses_of_one_world(small, ones, case):
    """One sentence, before anything is drawn, inside jit, too."""
    draw = small.renderer({"agentview": (16, 12)}).of_world
    wrong, says = OF_ONE[case]
    for function in (draw, jax.jit(draw)) if case != "a model of C" else (draw,):  # which JAX refuses itself
        with pytest.raises((ValueError, TypeError)) as raised:
            function(*wrong(*ones))
        assert str(raised.value).startswith(says)
