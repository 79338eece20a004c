"""The plan view: what is drawn is where the world has it, and all numbers are there."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import test_scenes
from matplotlib.patches import Circle, Polygon

import mjx_arenas as mja
from mjx_arenas.extents import extents
from mjx_arenas.viz import plan

SCENE = """<mujoco><worldbody><geom type="plane" size="0 0 1"/>
  <body name="desk" pos="1 0 .7" euler="0 0 .4"><geom name="top" type="box" size=".6 .4 .02" pos="0 .1 .02" euler="0 0 .2"/>
    <geom name="lamp" type="cylinder" size=".03 .2" pos=".3 .1 .24"/></body>
  <body name="shelf" pos="-1 0 .7"><geom name="board" type="box" size=".3 .5 .02"/></body>
  <body pos="0 1 1" euler=".3 .5 .2"><geom type="ellipsoid" size=".1 .2 .3"/><geom type="capsule" size=".05 .2" pos=".5 0 0"/></body>
</worldbody></mujoco>"""


def arena():
    objects = [
        mja.Object("wedge", "mesh", file=test_scenes.DATA / "wedge.obj", table="desk"),
        mja.Object("rod", "capsule", (0.12, 0.04, 0.04), table="shelf"),
        mja.Object("box", table="shelf"),
    ]
    return mja.Arena.from_xml(SCENE, ["desk", "shelf"], objects=objects)


def polygons(figure, zorder):
    return [p.get_xy()[:-1] for p in figure.axes[0].patches if isinstance(p, Polygon) and p.get_zorder() == zorder]


def test_outlines():
    """Outlines reach as far as the geoms do, along any direction, however these are turned."""
    model = arena().mj_model
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    data.qpos[:] = rng.normal(size=model.nq)
    mujoco.mj_kinematics(model, data)
    yaw = 0.7
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    for g in range(model.ngeom):
        points = plan.outline(model, data, g)
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_PLANE:
            assert points is None
            continue
        low, high = extents(model, data, np.arange(model.ngeom) == g, np.zeros(3), turn)
        round_off = 0.3 * (1 - np.cos(np.pi / 48))  # a circle is a polygon of 48 corners
        np.testing.assert_allclose((points @ turn[:2, :2]).min(0), low[:2], rtol=0, atol=round_off)
        np.testing.assert_allclose((points @ turn[:2, :2]).max(0), high[:2], rtol=0, atol=round_off)


def test_plan_is_to_scale():
    """Tables are the rectangles of their slabs, objects where the data has them, reach where it is asked for."""
    a = arena()
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(-3, 3), table_full_sizes=mja.Uniform(0.5, 0.9))
    params = a.sample_params(jax.random.key(1), ranges)
    model, c = a.c_world(params)
    c.qpos[7] += 0.2
    mujoco.mj_forward(model, c)
    figure = a.plan(params, c, reach=[((0.5, 0.25), 0.8)], title="world 1")
    slabs = [plan.outline(model, c, model.geom(name).id) for name in ("board", "top")]  # the lower one first
    for drawn, slab in zip(polygons(figure, 2), slabs, strict=True):
        assert len(drawn) == len(slab) == 4
        away = np.linalg.norm(drawn[:, None] - slab[None], axis=-1).min(1)
        np.testing.assert_allclose(away, 0, atol=1e-6)
    rod = polygons(figure, 5)[1]
    np.testing.assert_allclose((rod.min(0) + rod.max(0)) / 2, c.body("rod").xpos[:2], atol=1e-6)
    assert len(polygons(figure, 4)) == 3  # the lamp and what stands in the world
    (circle,) = [p for p in figure.axes[0].patches if isinstance(p, Circle)]
    assert (circle.get_center(), circle.get_radius()) == (pytest.approx((0.5, 0.25)), 0.8)
    names = {text.get_text() for text in figure.axes[0].texts}
    assert {"desk", "shelf", "wedge", "rod", "box", "reach 0.8 m"} <= names
    assert figure.axes[0].get_title() == "world 1"
    assert figure.axes[0].get_aspect() == 1
    notes = figure.axes[1].texts[0].get_text().splitlines()
    row = next(line for line in notes if line.startswith("rod"))
    assert row.split()[-1] == f"{np.linalg.norm(c.body('rod').xpos[:2] - [0.5, 0.25]):.3f}"
    row = next(line for line in notes if line.startswith("desk"))
    assert f"{np.degrees(params.table_rots[0]):.1f}" in row
    figure.draw_without_rendering()  # all texts and hatches are known


def test_absent_is_listed_not_drawn():
    a = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("a"), mja.Object("b", table=1)])
    figure = a.plan(a.nominal_params()._replace(table_active=jnp.array([True, False])), reach=np.float32(0.7))
    assert len(polygons(figure, 2)) == len(polygons(figure, 5)) == 1
    assert {text.get_text() for text in figure.axes[0].texts} == {"table0", "a", "reach 0.7 m", "origin"}
    notes = figure.axes[1].texts[0].get_text().splitlines()
    assert [line.split() for line in notes if line.startswith(("table1", "b"))] == [
        ["table1", "absent"],
        ["b", "absent"],
    ]


def test_names_do_not_cover_each_other():
    """Not where boards lie above each other and things lie close."""
    objects = [mja.Object(f"thing{k}", full_size=0.04, table=k % 3, pos=(0.05 * (k // 3), 0)) for k in range(12)]
    a = mja.MultiTableArena([[0, 0, z] for z in (0.4, 0.8, 1.2)], has_legs=False, objects=objects)
    figure = a.plan(a.nominal_params())
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    assert len(boxes) == 12 + 3 + 1
    frame = figure.axes[0].get_window_extent()
    assert all(frame.contains(*corner) for box in boxes for corner in (box.min, box.max))
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])


@pytest.mark.parametrize(
    ("reach", "message"),
    [
        (-1, "`reach` must have radii > 0 [m], got -1."),
        ([0.5], "`reach` must be one radius, or ((x, y), radius) for each circle [m], got [0.5]."),
        ([((0, 0, 0), 1)], "`reach` must be 2 finite numbers [m], got (0, 0, 0)."),
    ],
)
def test_bad_reach(reach, message):
    a = mja.TableArena()
    with pytest.raises(ValueError, match="reach") as error:
        a.plan(a.nominal_params(), reach=reach)
    assert str(error.value) == message
