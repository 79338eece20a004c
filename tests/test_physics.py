"""Objects meet the tables where each world has them: MJX on JAX and on Warp, C MuJoCo's batch, and C MuJoCo recompiled."""

import functools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds
from mujoco import mjx

import mjx_arenas as mja

pytestmark = pytest.mark.slow

SETTLE = 250  # steps of 2 ms
EARLY = 60  # steps, through the first impact: 2 cm take 32
DROP = 0.02  # [m]
TOLERANCE = 2e-4  # [m] between engines, of what rests
ENGINES = ["jax", "warp", "c_batch"]


def qpos_of_all(data):
    return data.qpos


def raised(arena, data):
    """The data with all objects lifted by DROP."""
    lift = np.zeros(arena.mj_model.nq, np.float32)
    lift[arena.layout.object_qpos[:, 2]] = DROP
    return data.replace(qpos=data.qpos + lift)


@functools.cache
def start(n_worlds=6):
    """An arena, its worlds' parameters and the state from which all engines start."""
    arena = worlds.arena(3)
    keys = jax.random.split(jax.random.key(0), n_worlds)
    batch = arena.randomize(arena.put_model("jax"), keys, worlds.RANGES)
    assert jax.vmap(arena.place)(batch.params, keys).valid.all()
    return arena, batch.params, keys, np.asarray(raised(arena, mja.make_data(batch, keys)).qpos)


@functools.cache
def trajectory(engine):
    """(SETTLE, W, nq) qpos of the same worlds on an engine."""
    arena, params, keys, qpos0 = start()
    if engine in ("jax", "warp"):
        batch = arena.randomize(arena.put_model(engine), keys, worlds.RANGES)
        first = raised(arena, mja.make_data(batch, keys))
        return np.asarray(mja.rollout(batch, first, SETTLE, record=qpos_of_all)[1])
    if engine == "c_batch":
        batch = arena.c_batch(params, keys=keys)
        batch.qpos = qpos0
        return batch.rollout(SETTLE)["qpos"].swapaxes(0, 1)
    return np.stack([recompiled(arena, worlds.take(params, i), qpos0[i]) for i in range(len(qpos0))], axis=1)


def recompiled(arena, params, qpos0):
    """(SETTLE, nq) qpos of C MuJoCo on the model compiled for this world."""
    model = arena.compile(params)
    data = mujoco.MjData(model)
    data.qpos = qpos0
    qpos = np.empty((SETTLE, model.nq))
    for row in qpos:
        mujoco.mj_step(model, data)
        row[:] = data.qpos
    return qpos


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
@pytest.mark.parametrize("engine", ENGINES)
def test_resting_heights(engine):
    """All objects rest where C MuJoCo has them in the recompiled world, on their tables, not on the template's."""
    arena, params, _, _ = start()
    z = trajectory(engine)[-1][:, arena.layout.object_qpos[:, 2]]
    reference = trajectory("recompiled")[-1][:, arena.layout.object_qpos[:, 2]]
    np.testing.assert_allclose(z, reference, rtol=0, atol=TOLERANCE)
    rest = worlds.rest_heights(arena, params)
    assert np.abs(z - rest).max() < 1e-3
    nominal = arena.nominal_params()
    template = worlds.rest_heights(arena, jax.tree.map(lambda x: x[None], nominal))
    away = np.abs(rest - template) > 0.01
    assert away.mean() > 0.9
    assert (np.abs(z - template) > 5e-3)[away].all()


@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("engine", ENGINES)
def test_early_trajectories(engine):
    """Engines agree to float32 rounding while falling, and to the contact models' difference through the impact."""
    arena, *_ = start()
    z = arena.layout.object_qpos[:, :3]
    got, reference = trajectory(engine)[:EARLY][..., z], trajectory("recompiled")[:EARLY][..., z]
    falling = slice(0, 30)
    np.testing.assert_allclose(got[falling], reference[falling], rtol=0, atol=30 * 2.0**-22 * 4)  # 30 steps, |x| < 4 m
    np.testing.assert_allclose(got, reference, rtol=0, atol=1e-3)


@pytest.mark.xslow
@pytest.mark.slow
def test_ten_thousand_worlds():
    """10,000 random worlds in C: every object rests on its own table."""
    arena = worlds.arena(3)
    keys = jax.random.split(jax.random.key(7), 10_000)
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, worlds.RANGES)))(keys)
    valid = np.asarray(jax.jit(jax.vmap(arena.place))(params, keys).valid)
    assert valid.all()
    batch = arena.c_batch(params, keys=keys)
    qpos = np.array(batch.qpos)
    qpos[:, arena.layout.object_qpos[:, 2]] += 0.005
    batch.qpos = qpos
    batch.step(nstep=80)  # a fall of 16 steps
    off = np.asarray(batch.qpos)[:, arena.layout.object_qpos[:, 2]] - worlds.rest_heights(arena, params)
    assert np.abs(off).max() < 1e-3
    assert (
        np.abs(
            np.asarray(batch.qpos)[:, arena.layout.object_qpos[:, :2]] - qpos[:, arena.layout.object_qpos[:, :2]]
        ).max()
        < 0.01
    )


def test_c_batch_is_the_recompiled_model():
    """Every number of C MuJoCo's model, bounding volumes and short-cuts too; visual statistics are not per simulation."""
    arena, params, keys, _ = start()
    batch = arena.c_batch(params, keys=keys)
    for i in range(4):
        assert_same_model(batch.get_model(i), arena.compile(worlds.take(params, i)))


def assert_same_model(got, expected):
    """Every number of a simulation's model is the compiled one's."""
    compared = 0
    for name in dir(expected):
        want = None if name.startswith("_") else getattr(expected, name)
        if isinstance(want, np.ndarray) and want.size and want.dtype.kind in "fiu":
            np.testing.assert_allclose(getattr(got, name), want, rtol=1e-6, atol=2e-6, err_msg=name)
            compared += 1
    assert compared > 100


SLIDE = 300  # steps, in which all stop but that on the most slippery table


def slid(engine, friction):
    """(W,) how far [m] a cube slides that starts at 1 m/s, on tables of other heights and of these frictions."""
    arena = mja.TableArena(table_full_size=(3, 1, 0.05), objects=[mja.Object("cube")])
    params = jax.vmap(lambda f, z: arena.nominal_params()._replace(table_frictions=f, table_offsets=z))(
        jnp.array([[[f, 0.005, 0.0001]] for f in friction]),
        jnp.array([[[0, 0, 0.8 - 0.1 * i]] for i in range(len(friction))]),
    )
    if engine == "c_batch":
        batch = arena.c_batch(params)
        batch.qvel = np.eye(6)[0]
        batch.step(nstep=SLIDE)
        return np.asarray(batch.qpos)[:, 0]
    batch = arena.batch(arena.put_model(engine), params)
    data = mja.make_data(batch)
    data = data.replace(qvel=data.qvel.at[:, 0].set(1.0))
    return np.asarray(mja.rollout(batch, data, SLIDE).qpos)[:, 0]


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
@pytest.mark.parametrize("engine", ENGINES)
def test_lower_friction_slides_farther(engine):
    """A pushed cube slides v^2 / (2 mu g), also where the table is more slippery than the cube (1.0)."""
    friction = np.array([0.1, 0.2, 0.4, 0.8])
    distance = slid(engine, friction)
    assert (np.diff(distance) < 0).all()
    np.testing.assert_allclose(distance[1:], 1 / (2 * 9.81 * friction[1:]), rtol=0.15)
    assert distance[0] > 0.4


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("jax")
def test_moved_mid_run(impl):
    """`place_static` lets a table collide where its world's model has moved it."""
    arena = worlds.arena(1, objects=worlds.OBJECTS[1:2])
    model = arena.put_model(impl)
    lower = arena.nominal_params()._replace(table_offsets=jnp.array([[0.0, 0.0, 0.7]]))
    step = jax.jit(lambda m, d: jax.lax.scan(lambda d, _: (mjx.step(m, d), None), d, length=150)[0])
    data = step(model, arena.make_world_data(model, arena.nominal_params()))
    rest = arena.nominal_params().object_full_sizes[:, 2] / 2
    heights = arena.layout.object_qpos[:, 2]
    np.testing.assert_allclose(data.qpos[heights], 0.8 + rest, atol=1e-3)
    model = arena.apply(model, lower)
    data = step(model, mja.place_static(model, data))  # a fall of 71 steps
    np.testing.assert_allclose(data.qpos[heights], 0.7 + rest, atol=1e-3)


@pytest.mark.slow
def test_gradient_of_height():
    """A loss of what stands on a table has the finite differences' gradient with respect to the table's height."""
    arena = worlds.arena(2)
    model = arena.put_model("jax")

    def site_heights(z):
        params = arena.nominal_params()
        params = params._replace(table_offsets=params.table_offsets.at[:, 2].set(z))
        one = arena.apply(model, params)
        data = mjx.kinematics(one, arena.make_world_data(one, params))
        return (
            (data.site_xpos[:, 2] ** 2).sum()
            + (data.geom_xpos[:, 2] * jnp.arange(model.ngeom)).sum()
            + one.geom_rbound.sum()
        )

    z = jnp.array([0.7, 0.9])
    gradient = jax.jit(jax.grad(site_heights))(z)
    step = 1e-2
    value = jax.jit(site_heights)
    differences = [(value(z + step * e) - value(z - step * e)) / (2 * step) for e in jnp.eye(2)]
    assert np.isfinite(gradient).all()
    np.testing.assert_allclose(gradient, differences, rtol=2e-3)


@pytest.mark.slow
def test_gradient_through_steps():
    """Forward-mode gradients of a resting height through steps of contact are finite and follow the table."""
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere")])
    model = arena.put_model("jax")

    def resting_height(z):
        params = arena.nominal_params()
        params = params._replace(table_offsets=params.table_offsets.at[0, 2].set(z))
        one = arena.apply(model, params)
        data = jax.lax.scan(lambda d, _: (mjx.step(one, d), None), arena.make_world_data(one, params), length=20)[0]
        return data.qpos[2]

    height, slope = jax.jit(lambda z: jax.jvp(resting_height, (z,), (1.0,)))(0.75)
    assert height == pytest.approx(0.775, abs=1e-3)
    assert slope == pytest.approx(1.0, abs=1e-2)


def test_c_batch_collides_what_jax_cannot():
    """An arena with a pair of geoms that MJX on JAX refuses still runs on C MuJoCo's threads."""
    post = '<mujoco><worldbody><geom name="post" type="cylinder" size=".1 .1" pos="3 0 0"/></worldbody></mujoco>'
    arena = mja.TableArena(xml=post, objects=[mja.Object("cube")])
    batch = arena.c_batch(jax.tree.map(lambda x: x[None], arena.nominal_params()))
    batch.step(nstep=200)
    assert batch.qpos[0, 2] == pytest.approx(0.825, abs=1e-3)


MORE = {  # what MJX on JAX refuses, and what of the model is to be there
    "adhesion": (
        '<worldbody><body name="pad" pos="3 0 1"><joint/><geom size=".1"/></body></worldbody>'
        '<actuator><adhesion body="pad" ctrlrange="0 1" gain="9"/></actuator>',
        lambda model: model.nu == 1,
    ),
    "cloth": (
        '<worldbody><flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" pos="3 0 1" radius=".01" mass=".1">'
        '<edge equality="true"/><contact selfcollide="none"/></flexcomp></worldbody>',
        lambda model: model.nflex == 1,
    ),
    "energy": ('<option><flag energy="enable"/></option>', lambda model: model.opt.enableflags != 0),
    "implicit": ('<option integrator="implicit" density="1.2"/>', lambda model: model.opt.density > 0),
    "pair": (
        '<worldbody><geom name="post" type="cylinder" size=".1 .1" pos="3 0 1"/><body pos="3 0 1.4"><freejoint/>'
        '<geom name="block" type="box" size=".1 .1 .1"/></body></worldbody><contact><pair geom1="post" geom2="block"/></contact>',
        lambda model: model.npair == 1,
    ),
    "sensor": (
        '<worldbody><site name="here" size=".1"/></worldbody><sensor><contact site="here" num="1" data="found"/><e_potential/></sensor>',
        lambda model: model.nsensor == 2,
    ),
}


@pytest.mark.parametrize("more", MORE)
def test_c_batch_simulates_what_mjx_does_not(more):
    """Worlds with what MJX on JAX refuses are those that MuJoCo compiles, and step."""
    mjcf, is_there = MORE[more]
    objects = [mja.Object("cube"), mja.Object("ball", "sphere", 0.06)]
    arena = mja.TableArena(xml=f"<mujoco>{mjcf}</mujoco>", objects=objects)
    assert is_there(arena.mj_model)
    params = jax.vmap(lambda key: arena.sample_params(key, worlds.RANGES))(jax.random.split(jax.random.key(1), 2))
    batch = arena.c_batch(params)
    for i in range(2):
        assert_same_model(batch.get_model(i), arena.compile(worlds.take(params, i)))
    batch.step(nstep=200)
    off = np.asarray(batch.qpos)[:, arena.layout.object_qpos[:, 2]] - worlds.rest_heights(arena, params)
    assert np.abs(off).max() < 1e-3
