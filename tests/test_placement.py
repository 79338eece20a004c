"""Objects in their places: inside the edges, apart, and flagged where there is no place."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import worlds

import mjx_arenas as mja


def placed(arena, ranges, n, seed=0):
    """Parameters and placements of n worlds."""
    keys = jax.random.split(jax.random.key(seed), n)
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys)
    return params, jax.jit(jax.vmap(arena.place))(params, keys)


def corners(obj):
    """(n, 2) points on the rim of an object's footprint, in its own frame."""
    half = np.broadcast_to(np.asarray(obj.full_size) / 2, 3)[:2]
    radius = 0.0 if obj.type == "box" else half[1]
    around = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rim = radius * np.stack([np.cos(around), np.sin(around)], axis=1)
    return np.concatenate([rim + (half - radius) * [sx, sy] for sx in (-1, 1) for sy in (-1, 1)])


def turned(yaw, xy):
    c, s = np.cos(yaw), np.sin(yaw)
    return xy @ np.array([[c, s], [-s, c]])


def test_what_a_thin_slab_bares():
    """What hangs on a table, as high as its slab, stands above it where the slab is thinner."""
    xml = """<mujoco><worldbody><body name="desk" pos="0 0 .75"><geom name="top" type="box" size=".4 .4 .05"/>
      <geom type="box" size=".1 .4 .04"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml, ["top"], objects=[mja.Object("ball", "sphere", 0.06)])
    params, keys = arena.nominal_params(), jax.random.split(jax.random.key(0), 200)
    place = jax.jit(jax.vmap(arena.place, in_axes=(None, 0)))
    for thickness, clear in ((0.1, 0.0), (0.04, 0.13)):
        world = params._replace(table_full_sizes=params.table_full_sizes.at[0, 2].set(thickness))
        found = place(world, keys)
        assert found.valid.all()
        nearest = np.abs(np.asarray(found.qpos)[:, 0, 0]).min()
        assert nearest >= clear - 1e-6
        assert nearest < clear + 0.02


@pytest.mark.slow
def test_inside_and_apart():
    """On crowded tables, footprints stay inside the edges, and C MuJoCo finds a gap between all objects that were placed."""
    objects = [
        mja.Object(f"o{i}", ("box", "sphere", "capsule")[i % 3], (0.1, (0.12,) * 3, (0.2, 0.06, 0.06))[i % 3])
        for i in range(14)
    ]
    arena = mja.TableArena(objects=objects)
    params, found = placed(
        arena, worlds.TABLES._replace(table_full_sizes=mja.Uniform([0.45, 0.45, 0.02], [0.7, 0.7, 0.2])), 40
    )
    valid = np.asarray(found.valid)
    assert 0.5 < valid.mean() < 1.0  # crowded, but not hopeless
    for i in range(40):
        world = worlds.take(params, i)
        offset, rot, half = (
            np.asarray(world.table_offsets[0]),
            float(world.table_rots[0]),
            np.asarray(world.table_full_sizes[0]) / 2,
        )
        qpos = np.asarray(found.qpos[i])
        for k in np.flatnonzero(valid[i]):
            yaw = 2 * np.arctan2(qpos[k, 6], qpos[k, 3])
            rim = turned(-rot, turned(yaw, corners(objects[k])) + qpos[k, :2] - offset[:2])
            assert (np.abs(rim) <= half[:2] + 1e-5).all()
        model = arena.compile(world)
        model.geom_margin[:] = 0.0
        data = mujoco.MjData(model)
        data.qpos = qpos.reshape(-1)
        mujoco.mj_forward(model, data)
        ids = [model.geom(f"{o.name}_g0").id for o in objects]
        for a in range(14):
            for b in range(a):
                if valid[i, a] and valid[i, b]:
                    assert mujoco.mj_geomDistance(model, data, ids[a], ids[b], 0.5, np.zeros(6)) > 0
        assert all(contact.dist > -1e-5 for contact in data.contact)  # those without a place touch nothing either


def test_too_large_for_its_table():
    """An object larger than its table has no place, says so, and starts above everything, apart from the next one."""
    objects = [
        mja.Object("big", full_size=0.4, pos=(-0.5, 0)),
        mja.Object("long", full_size=(0.5, 0.1, 0.1), pos=(0.5, 0)),
    ]
    arena = mja.TableArena((1.5, 0.5, 0.05), objects=objects)
    small = arena.nominal_params()._replace(table_full_sizes=jnp.array([[0.3, 0.3, 0.05]]))
    found = jax.jit(arena.place)(small, jax.random.key(0))
    assert not found.valid.any()
    bottoms = np.asarray(found.qpos[:, 2]) - [0.2, 0.05]
    assert bottoms[0] >= 0.8
    assert bottoms[1] >= found.qpos[0, 2] + 0.2 - 1e-6


@pytest.mark.slow
def test_without_a_place_on_another_one():
    """Over the table on which that one stands, or would."""
    objects = [mja.Object(name, full_size=(0.3, 0.3, 0.1)) for name in ("w", "a")] + [
        mja.Object("b", full_size=0.05, on="a")
    ]
    with pytest.warns(UserWarning, match="do not all fit side by side"):
        arena = mja.TableArena((0.4, 0.4, 0.05), objects=objects)
    with pytest.warns(UserWarning, match="above the others"):
        assert arena.mj_model.nbody == 5
    place = jax.jit(jax.vmap(arena.place, in_axes=(None, 0)))
    found = place(arena.nominal_params(), jax.random.split(jax.random.key(0), 100))
    without = ~np.asarray(found.valid[:, 2])
    assert without.sum() > 50
    assert (abs(np.asarray(found.qpos[without, 2, :2])) < 0.2).all()


@pytest.mark.slow
def test_without_a_place_over_its_own_table():
    """Also where it was tried beside the table: what fits reaches over no edge, and what is too large starts over the middle."""
    objects = [mja.Object(f"o{i}", full_size=(0.2, 0.3, 0.1), place=mja.Place(margin=0.02)) for i in range(3)]
    arena = mja.TableArena((0.45, 0.4, 0.05), objects=objects)
    with pytest.warns(UserWarning, match="start above the others"):
        assert arena.mj_model.nbody == 5
    nominal = arena.nominal_params()
    place = jax.jit(jax.vmap(arena.place, in_axes=(None, 0)))
    turned = nominal._replace(table_rots=jnp.array([0.4]), table_offsets=jnp.array([[0.3, -0.2, 0.8]]))
    for size, low in (((0.45, 0.4), 0.045), ((0.15, 0.4), 0.0)):
        params = turned._replace(table_full_sizes=jnp.array([[*size, 0.05]]))
        found = place(params, jax.random.split(jax.random.key(0), 50))
        there, xy = np.asarray(found.valid), np.asarray(found.qpos[..., :2]) - [0.3, -0.2]
        assert (~there).sum() > 40
        local = xy @ np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
        room = np.maximum(np.array(size) / 2 - np.hypot(0.1, 0.15), 0.0)
        assert (abs(local[~there]) <= room + 1e-6).all()
        assert room[0] == pytest.approx(low, abs=1e-3)


def test_as_large_as_its_table():
    """Exactly as large, and parallel: there is a place in theory, and none in practice; a hair smaller disc always fits."""
    disc = mja.TableArena((0.3, 0.3, 0.05), objects=[mja.Object("ball", "sphere", 0.299)])
    assert placed(disc, mja.ArenaRanges(), 20)[1].valid.all()


def test_another_slab_in_the_way():
    """A place under or in another table's slab is not free."""
    with pytest.warns(UserWarning, match="overlap"):
        arena = mja.MultiTableArena([[0, 0, 0.8], [0.3, 0, 0.8]], objects=[mja.Object("cube", full_size=0.1)])
    params = arena.nominal_params()
    higher = params._replace(table_offsets=params.table_offsets.at[1, 2].set(0.84))
    place = jax.jit(jax.vmap(arena.place, in_axes=(None, 0)))
    found = place(higher, jax.random.split(jax.random.key(0), 200))
    assert found.valid.all()
    qpos = np.asarray(found.qpos)[:, 0]
    x, yaw = qpos[:, 0], 2 * np.arctan2(qpos[:, 6], qpos[:, 3])
    assert (x + 0.05 * (np.abs(np.cos(yaw)) + np.abs(np.sin(yaw))) <= -0.1 + 1e-6).all()  # that slab begins at x = -0.1
    over = params._replace(table_offsets=params.table_offsets.at[1].set(jnp.array([0.0, 0.0, 0.84])))
    assert not place(over, jax.random.split(jax.random.key(0), 200)).valid.any()
    far_over = params._replace(table_offsets=params.table_offsets.at[1].set(jnp.array([0.0, 0.0, 1.0])))
    assert place(far_over, jax.random.split(jax.random.key(0), 200)).valid.all()


@pytest.mark.slow
def test_one_more_object_moves_no_other():
    """Places are drawn in order: the first objects stay where they are when one is added."""
    few, more = ([mja.Object(f"o{i}", on=i % 2) for i in range(n)] for n in (4, 5))
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
    a, b = (placed(mja.MultiTableArena(worlds.offsets(2), objects=o), ranges, 5)[1].qpos for o in (few, more))
    np.testing.assert_array_equal(a, b[:, :4])


@pytest.mark.slow
def test_nominal_places_that_overlap_are_a_warning():
    """Objects that start inside each other at their nominal places are named."""
    objects = [mja.Object("a", full_size=0.1, pos=(0, 0)), mja.Object("b", full_size=0.1, pos=(0.05, 0))]
    says = r"'a' and 'b' start 0\.050 m inside each other .*keys draws free ones\.$"
    with pytest.warns(UserWarning, match=says):
        mja.TableArena(objects=objects).put_model("jax")
    arena = mja.TableArena(objects=objects)
    with pytest.warns(UserWarning, match=says):  # compiled while it is traced
        found = jax.jit(lambda key: arena.place(arena.nominal_params(), key))(jax.random.key(0))
    assert found.valid.all()
