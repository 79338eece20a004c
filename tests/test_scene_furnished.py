"""A scene of one's own with furniture: its objects stand on parts, and parts and robots on its tables, beside what follows a slab."""

import jax
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
SCENE = """<mujoco><compiler angle="degree"/><worldbody><geom name="floor" type="plane" size="0 0 .1"/>
  <body name="room" pos="1 0 0" euler="0 0 30"><frame pos="0 0 .7"><body name="desk">
    <geom name="top" type="box" size=".6 .5 .02"/><geom name="screen" type="box" size=".5 .01 .2" pos="0 .45 .22"/>
    <geom name="leg" type="capsule" size=".03 .3" pos="-.5 -.4 -.36"/></body></frame></body>
  <body name="bottle" pos="1.1 -.1 .75" euler="90 20 0"><freejoint name="of_bottle"/><geom type="box" size=".03 .03 .1"/>
    <geom type="capsule" size=".01 .04" pos="0 0 .12"/></body>
  <body name="mug" pos=".9 -.2 .76"><freejoint/><geom type="box" size=".04 .04 .04"/></body></worldbody></mujoco>"""
ARM = '<mujoco><worldbody><body name="base"><geom size=".03" pos="0 0 .1"/></body></worldbody></mujoco>'
CORNER, BACK = mja.Place(region=((-1, -1), (0, 0))), mja.Place(region=((-1, 0.4), (1, 1)))
RANGES = mja.ArenaRanges(
    table_offsets=U([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    table_rots=U(-0.5, 0.5, relative="add"),
    table_full_sizes=U(0.9, 1.2, relative="scale"),
    object_tables=mja.Choice([0, 2, 3]),
    terms={"bench.widths": U(0.7, 0.9), "tray.pos": U([-0.05, -0.05, 0], [0.05, 0.05, 0], relative="add")},
)


def furnished(xml):
    follow = (mja.Follow("screen", x="both", y="+", z="+"), mja.Follow("leg", x="-", y="-", z="floor"))
    objects = ("bottle", mja.Object("mug", "scene", place=CORNER))
    arena = mja.Arena.from_xml(xml, ["top"], objects=objects, follow=follow)
    arena.add_part(furniture.Bin("tray", pos=(0.3, 0.15, 0), inner_size=(0.3, 0.3, 0.03), on="desk"))
    arena.add_part(furniture.Counter("bench", pos=(3, 0, 0), widths=(0.8, 0.8), stays=True))
    arena.attach(ARM, "arm_", pos=(0.1, 0.3, 0), on="bench_top1")
    arena.attach(ARM, "own_", pos=(-0.4, -0.3, 0), on="top")
    arena.add_object(mja.Object("book", full_size=(0.2, 0.12, 0.03), on="bench_top1", place=BACK))
    return arena


@pytest.fixture(scope="module")
def arena():
    return furnished(SCENE)


@pytest.mark.slow
def test_worlds_are_compiled(arena, impl):
    """All numbers others than nominal, objects on the next surface, the bottle on the tray too: each field as in the recompiled model."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    numbers = [name for name in (*nominal._fields, *arena.quantities) if not name.endswith(("active", "terms"))]
    for far in (0.2, 0.1):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert [arena.surfaces[t] for t in params.object_tables] == ["tray_bottom", "tray_bottom", "desk"]
        assert (
            oracle.from_compiled(arena.apply(template, params), arena.compile(params))
            <= oracle.STRUCTURE_MAY_DIFFER.keys()
        )


@pytest.mark.slow
def test_placed(arena):
    """In C, objects touch neither screen nor tray where keys place them, and rest there: the mug in its corner, the bottle lying."""
    assert arena.surfaces == ["desk", "tray_bottom", "bench_top0", "bench_top1"]
    keys = mja.world_keys(0, range(48))
    params = jax.vmap(lambda key: arena.sample_params(key, RANGES))(keys)
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    heights = np.asarray(jax.vmap(arena.rest_heights)(params))
    assert jax.vmap(arena.valid)(params).all()
    assert placed.valid.all()
    assert [np.unique(on).tolist() for on in np.asarray(params.object_tables).T] == [[0, 2, 3]] * 3
    for w in range(48):
        p = jax.tree.map(lambda x, w=w: np.asarray(x)[w], params)
        model, c = arena.c_world(p, key=keys[w])
        free = [model.body(o.name).id for o in arena.objects]
        for contact in c.contact:
            mine = set(free) & set(model.geom_bodyid[contact.geom].tolist())
            assert not mine or contact.dist > -1e-5, [model.geom(g).name for g in contact.geom]
        below = "top" if p.object_tables[1] == 0 else arena.surfaces[p.object_tables[1]]
        local = c.geom(below).xmat.reshape(3, 3).T @ (c.body("mug").xpos - c.geom(below).xpos)
        assert (local[:2] <= -0.04 + 1e-5).all()
        assert abs(c.body("bottle").xmat.reshape(3, 3)[2, 2]) < 1e-6
        np.testing.assert_allclose(c.xpos[free, 2], heights[w], atol=1e-5)
        mujoco.mj_step(model, c, 100)
        np.testing.assert_allclose(c.xpos[free, 2], heights[w], atol=1.5e-3)


def test_files(tmp_path):
    """All of it is written, and read again."""
    (tmp_path / "scene.xml").write_text(SCENE)
    one = furnished(tmp_path / "scene.xml")
    mja.save(tmp_path / "arena.yaml", one, mja.ArenaRanges())
    again, _ = mja.load(tmp_path / "arena.yaml")
    assert again.record == one.record


@pytest.mark.slow
def test_bundles(arena, tmp_path):
    """A world in which a leg would be shorter than nothing is found, and said again by its bundle, with its objects and parts."""
    low = mja.Fixed([[0, 0, -0.68]], relative="add")
    report = mja.check(
        arena, mja.ArenaRanges(table_offsets=low, object_tables=mja.Fixed([2, 0, 1])), 1, n_steps=5, engine="c"
    )
    assert "Geom 'leg', which follows table 'desk'" in report.of(0)["invalid_arena"].what
    report.save_bundle(tmp_path / "bundle", 0)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.found == report.of(0)
