"""Objects that are dropped into a bin start above each other and come to rest in it, as in C; a flag says which do not rest."""

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture, quaternions

DROP = mja.Place(drop=True)


@pytest.fixture(scope="module")
def dropped():
    """Six objects in a bin on a table, in three worlds: where they start."""
    arena = mja.TableArena(
        (0.6, 0.6, 0.04), objects=[mja.Object("lamp", full_size=(0.05, 0.05, 0.2), pos=(0.25, 0.25))]
    )
    arena.add_part(furniture.Bin("bin", on="table", inner_size=(0.2, 0.2, 0.12)))
    sizes = ((0.08, 0.05, 0.03), (0.1, 0.04, 0.04), (0.06, 0.06, 0.02))
    for i in range(6):
        arena.add_object(mja.Object(f"part{i}", full_size=sizes[i % 3], on="bin_bottom", place=DROP, mass=0.1))
    ranges = mja.ArenaRanges(object_active=mja.Bernoulli(0.8), table_offsets=mja.Uniform(-0.1, 0.1, relative="add"))
    keys = mja.world_keys(0, range(3))
    batch = arena.randomize(arena.put_model("jax"), keys, ranges)
    return arena, batch, keys


@pytest.mark.slow
def test_starts(dropped):
    """In C: nothing touches anything. A plain loop over the parts that are there finds the same heights within the bin."""
    arena, batch, keys = dropped
    assert jax.vmap(arena.place)(batch.params, keys).valid.all()
    beside, above = 0, 0
    for w in range(3):
        p = jax.tree.map(np.asarray, batch.world(w))
        _, c = arena.c_world(p, key=keys[w])
        assert not [contact for contact in c.contact if contact.dist < -1e-5]
        floor, below = p.table_offsets[0, 2] + 0.01, []
        for i in range(6):
            if not p.object_active[1 + i]:
                continue
            part, size = c.body(f"part{i}"), p.object_full_sizes[1 + i]
            outline = corners(part.xpos, part.xmat.reshape(3, 3), size)
            start = max([top + 0.005 for other, top in below if touch(outline, other)], default=floor)
            above += start > floor
            beside += bool(below) and start < max(top for _, top in below)
            assert part.xpos[2] == pytest.approx(start + size[2] / 2, abs=1e-5)
            below.append((outline, start + size[2]))
    assert above
    assert beside


def corners(pos, turn, size):
    """(4, 2) of a box seen from above, in order."""
    signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    return pos[:2] + (signs * size[:2] / 2) @ turn[:2, :2].T


def touch(one, other):
    """Whether two rectangles overlap: no side of either separates them."""
    for side in np.concatenate([one - np.roll(one, 1, 0), other - np.roll(other, 1, 0)]):
        across = np.array([-side[1], side[0]])
        a, b = one @ across, other @ across
        if a.max() < b.min() or b.max() < a.min():
            return False
    return True


@pytest.mark.xslow
@pytest.mark.slow
def test_settles(dropped):
    """After three seconds all are in the bin. Most rest: they hardly move in the next steps. In C of the same world all stay in it."""
    arena, batch, keys = dropped
    data = mja.make_data(batch, keys)
    settled = mja.settle(batch, data, 1500)
    rests = np.asarray(settled.rests)
    assert rests.mean() > 0.9  # soft contacts creep: what leans against a wall may slide on for long
    assert (settled.data.time == data.time).all()
    at = arena.layout.object_qpos[:, :3]
    later = mja.rollout(batch, settled.data, 75)
    moved = np.linalg.norm(np.asarray(later.qpos - settled.data.qpos)[:, at], axis=-1)
    assert moved[rests].max() < 3 * 0.005 * 0.15
    for w in range(3):
        p = jax.tree.map(np.asarray, batch.world(w))
        model, c = arena.c_world(p, mja.take(settled.data, w))
        there = [i for i in range(6) if p.object_active[1 + i]]
        start = np.array([c.body(f"part{i}").xpos for i in there])
        table = np.asarray(p.table_offsets[0])
        assert (np.abs(start[:, :2] - table[:2]) < 0.1).all()
        assert (start[:, 2] < table[2] + 0.01 + 0.12).all()
        for _ in range(250):
            mujoco.mj_step(model, c)
        end = np.array([c.body(f"part{i}").xpos for i in there])
        assert (np.abs(end[:, :2] - table[:2]) < 0.1).all()
        assert (np.abs(end - start) < 0.02).all()


@pytest.mark.slow
def test_settles_on_warp(dropped):
    """All are in the bin, most rest, and those do not move in the next steps."""
    arena, _, keys = dropped
    ranges = mja.ArenaRanges(table_offsets=mja.Uniform(-0.1, 0.1, relative="add"))
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    settled = mja.settle(batch, mja.make_data(batch, keys), 1500)
    rests, rows = np.asarray(settled.rests), arena.layout.object_qpos[:, :3]
    assert rests.mean() > 0.8
    at, table = np.asarray(settled.data.qpos)[:, rows], np.asarray(batch.params.table_offsets)
    assert (np.abs(at[:, 1:, :2] - table[:, :, :2]) < 0.1).all()
    assert (at[:, 1:, 2] < table[:, :, 2] + 0.01 + 0.12).all()
    later = np.asarray(mja.rollout(batch, settled.data, 75).qpos)[:, rows]
    assert np.linalg.norm(later - at, axis=-1)[rests].max() < 3 * 0.005 * 0.15


@pytest.mark.slow
def test_what_still_falls(dropped):
    """Too short a time is told, world by world and object by object; what is absent, or lies there from the start, rests."""
    arena, batch, keys = dropped
    settled = mja.settle(batch, mja.make_data(batch, keys), 20)
    active, rests = np.asarray(batch.params.object_active), np.asarray(settled.rests)
    assert rests[:, 0].all()
    assert rests[~active].all()
    above = np.cumsum(active[:, 1:], axis=1) > 2
    assert not rests[:, 1:][above & active[:, 1:]].any()
    dofs = arena.layout.model.body_dofadr[arena.layout.object_body]
    assert (np.abs(np.asarray(settled.data.qvel)[:, dofs + 2][~rests]) > 0.1).all()

    # What lies on the floor below its bin, or beside the bin on the table, does not move, but it does not rest where it was dropped.
    assert active[:, 1].any()
    at, dof = arena.layout.object_qpos[1], arena.layout.model.body_dofadr[arena.layout.object_body[1]]
    table = np.asarray(batch.params.table_offsets)[:, 0]
    lamp = np.asarray(mja.make_data(batch, keys).qpos)[:, arena.layout.object_qpos[0, 0]]
    beside = table + np.outer(np.where(lamp > table[:, 0], -0.22, 0.22), [1, 0, 0])  # away from the lamp
    for place in (np.zeros((3, 3)), beside):
        above = place + np.array([0, 0, 0.015])  # part0 is 0.03 m high
        pose = np.concatenate([above, np.tile([1.0, 0, 0, 0], (3, 1))], axis=1)
        data = mja.make_data(batch, keys)
        data = data.replace(qpos=data.qpos.at[:, at].set(pose))
        lying = mja.settle(batch, data, 20)
        assert (np.abs(np.asarray(lying.data.qvel)[:, dof : dof + 3]) < 0.005).all()
        assert (np.asarray(lying.rests)[:, 1] == ~active[:, 1]).all(), place


def test_angles():
    """Of turns from none to half a one, in single precision: what rests turns by less than a millionth of a radian."""
    rng, turns = np.random.default_rng(0), np.append(np.geomspace(1e-7, np.pi, 200), 0.0)
    one = rng.normal(size=(201, 4))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    other, axes = one.copy(), rng.normal(size=(201, 3))
    for q, axis, turn in zip(other, axes, turns, strict=True):
        mujoco.mju_quatIntegrate(q, axis / np.linalg.norm(axis), turn)
    got = jax.jit(quaternions.angle)(*(np.float32(x) for x in (one, -other)))
    np.testing.assert_allclose(got, turns, rtol=1e-6, atol=1e-6)  # of eight roundings by 6e-8, at most


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"n_steps": -1}, "`n_steps` must be a whole number >= 10, got -1."),
        ({"n_steps": 10, "speed": -1}, "`speed` must be >= 0 [m/s], got -1."),
        ({"n_steps": 10, "speed": "slow"}, "`speed` must be"),
    ],
)
def test_wrong(dropped, given, says):
    _, batch, keys = dropped
    data = mja.make_data(batch, keys)
    with pytest.raises((ValueError, TypeError)) as raised:
        mja.settle(batch, data, **given)
    assert str(raised.value).startswith(says)


def test_wrong_place():
    with pytest.raises(ValueError, match=r"Object 'a': `place.drop` must be true or false, got 1."):
        mja.TableArena(objects=[mja.Object("a", place=mja.Place(drop=1))])


@pytest.mark.slow
def test_example_in_c():
    """The example of a bin: in C, no part of 60 worlds goes through the bottom, which is 1 cm thick."""
    arena, ranges = mja.load("bin_picking")
    keys = mja.world_keys(0, range(60))
    params = jax.tree.map(np.asarray, jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))(keys))
    for w, key in enumerate(keys):
        p = jax.tree.map(lambda a, w=w: a[w], params)
        model, c = arena.c_world(p, key=key)
        mujoco.mj_step(model, c, nstep=500)
        there = [i for i in range(10) if p.object_active[i]]
        bottom = c.geom("bin_bottom").xpos[2] + model.geom("bin_bottom").size[2]
        assert min(c.body(f"part{i}").xpos[2] for i in there) > bottom, w


@pytest.fixture(scope="module")
def binned():
    """Plates that fall into a bin on each other."""
    arena = mja.TableArena()
    arena.add_part(furniture.Bin("bin", on="table", inner_size=(0.3, 0.3, 0.15), thickness=0.02))
    for i in range(6):
        arena.add_object(mja.Object(f"plate{i}", full_size=(0.15, 0.15, 0.01), on="bin_bottom", place=DROP))
    return arena


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["c", pytest.param("jax", marks=pytest.mark.xslow)])
def test_check_lets_objects_fall(binned, engine):
    """`check` judges what has come to rest: at once, impacts are deeper than what it calls deep, as it says if told not to wait."""
    report = mja.check(binned, mja.ArenaRanges(), 2, n_steps=20, engine=engine)
    assert report.settle_steps == 1000
    assert report.ok, report
    assert "1,000 steps in which dropped objects fall, then 20 steps or 0.04 s" in str(report)
    assert report.to_dict()["settle_steps"] == 1000


@pytest.mark.slow
def test_check_at_once(binned, tmp_path):
    """Without the wait the fall itself is judged; with a short one, a bundle begins after it and shows the same."""
    ranges = mja.ArenaRanges()
    at_once = mja.check(binned, ranges, 2, n_steps=120, engine="c", settle_steps=0)
    deep = at_once.failures["deep_penetration"][0]
    assert set(at_once.failures) == {"deep_penetration"}
    later = mja.check(binned, ranges, worlds=[deep.world], n_steps=120, engine="c", settle_steps=deep.step - 10)
    assert later.of(deep.world)["deep_penetration"].step == 10
    later.save_bundle(tmp_path / "bundle", deep.world)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.begins == "start"
    assert replay.found["deep_penetration"].step == 10


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Object 'foil'. `mass` is")
def test_what_sinks_through_is_seen():
    """A heavy foil that sinks through the bin's floor while it falls is reported after the fall."""
    arena = mja.TableArena()
    arena.add_part(furniture.Bin("bin", on="table", inner_size=(0.3, 0.3, 0.15), thickness=0.005))
    arena.add_object(mja.Object("foil", full_size=(0.1, 0.1, 0.0002), mass=50, on="bin_bottom", place=DROP))
    report = mja.check(arena, mja.ArenaRanges(), 1, n_steps=5, engine="c", settle_steps=200)
    assert report.of(0)["through_table"].step == 1
