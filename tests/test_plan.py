"""The plan view: what is drawn is where the world has it, and all numbers are there."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import test_scenes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Circle, Polygon

import mjx_arenas as mja
from mjx_arenas.spec.extents import extents
from mjx_arenas.viz import plan

SCENE = """<mujoco><worldbody><geom type="plane" size="0 0 1"/>
  <body name="desk" pos="1 0 .7" euler="0 0 .4"><geom name="top" type="box" size=".6 .4 .02" pos="0 .1 .02" euler="0 0 .2"/>
    <geom name="lamp" type="cylinder" size=".03 .2" pos=".3 .1 .24"/></body>
  <body name="shelf" pos="-1 0 .7"><geom name="board" type="box" size=".3 .5 .02"/></body>
  <body pos="0 1 1" euler=".3 .5 .2"><geom type="ellipsoid" size=".1 .2 .3"/><geom type="capsule" size=".05 .2" pos=".5 0 0"/></body>
</worldbody></mujoco>"""


def arena():
    objects = [
        mja.Object("wedge", "mesh", file=test_scenes.DATA / "wedge.obj", on="desk"),
        mja.Object("rod", "capsule", (0.12, 0.04, 0.04), on="shelf"),
        mja.Object("box", on="shelf"),
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


@pytest.mark.parametrize("dpi", [60, 80, 90, 100, 300])
def test_words_are_not_cut_off(dpi):
    """Not in small pictures, either, whose letters are wider."""
    a = mja.TableArena(objects=[mja.Object("cube")])
    figure = a.plan(a.nominal_params())
    figure.set_dpi(dpi)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert figure.axes[1].texts[0].get_window_extent(canvas.get_renderer()).x1 < figure.bbox.x1


def test_a_notebook_shows_it():
    """IPython asks what it displays for a PNG."""
    figure = mja.TableArena().plan(mja.TableArena().nominal_params())
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_absent_is_listed_not_drawn():
    a = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("a"), mja.Object("b", on=1)])
    figure = a.plan(a.nominal_params()._replace(table_active=jnp.array([True, False])), reach=np.float32(0.7))
    assert len(polygons(figure, 2)) == len(polygons(figure, 5)) == 1
    assert {text.get_text() for text in figure.axes[0].texts} == {"table0", "a", "reach 0.7 m", "origin"}
    notes = figure.axes[1].texts[0].get_text().splitlines()
    assert [line.split() for line in notes if line.startswith(("table1", "b"))] == [
        ["table1", "absent"],
        ["b", "absent"],
    ]


def test_without_a_free_place():
    """What starts in the air has a dashed outline, its height in its label, and does not hide what is below; what lies has not."""
    objects = [mja.Object(name, full_size=0.3, pos=(x, 0)) for name, x in (("first", -0.4), ("second", 0.4))]
    a = mja.TableArena((1.5, 0.5, 0.05), objects=objects)
    key, params = jax.random.key(0), a.nominal_params()._replace(table_full_sizes=jnp.array([[0.5, 0.5, 0.05]]))
    found = a.place(params, key)
    assert found.valid.tolist() == [True, False]
    _, c = a.c_world(params, key=key)
    figure = a.plan(params, c)
    (lies,), (floats,) = polygons(figure, 5), polygons(figure, 5.5)
    for corners, name in ((lies, "first"), (floats, "second")):
        np.testing.assert_allclose((corners.min(0) + corners.max(0)) / 2, c.body(name).xpos[:2], atol=1e-6)
    (dashed,) = [p for p in figure.axes[0].patches if p.get_zorder() == 5.5]
    assert (dashed.get_fill(), dashed.get_linestyle()) == (False, "--")
    height = c.body("second").xpos[2] - 0.15 - 0.8
    assert height > 0.29
    assert {f"second, {height:.2g} m above", "first"} <= {text.get_text() for text in figure.axes[0].texts}
    notes = figure.axes[1].texts[0].get_text().splitlines()
    assert [line.split()[1:3] for line in notes if line.startswith("second")] == [["above", "table"]]
    assert notes[-2:] == [
        "dashed: above its table or surface, as objects start",
        "that have no free place, or are dropped",
    ]

    c.qpos[7:9] += 5  # both lie beside each other now
    for height, lifted in ((2e-3, 1), (5e-4, 0)):
        c.qpos[9] = 0.95 + height
        mujoco.mj_forward(c.model, c)
        figure = a.plan(params, c)
        assert len(polygons(figure, 5.5)) == lifted
        assert ("dashed" in figure.axes[1].texts[0].get_text()) == bool(lifted)


def test_names_do_not_cover_each_other():
    """Not where boards lie above each other and things lie close."""
    objects = [mja.Object(f"thing{k}", full_size=0.04, on=k % 3, pos=(0.05 * (k // 3), 0)) for k in range(12)]
    a = mja.MultiTableArena([[0, 0, z] for z in (0.4, 0.8, 1.2)], has_legs=False, objects=objects)
    names = names_apart(a.plan(a.nominal_params()))
    assert len(names) == 12 + 1 + 1
    assert "table2 over table1 over table0" in names


def names_apart(figure):
    """The texts in the map, which do not cover each other nor leave it."""
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts]
    frame = figure.axes[0].get_window_extent()
    assert all(frame.contains(*corner) for box in boxes for corner in (box.min, box.max))
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])
    return [text.get_text() for text in figure.axes[0].texts]


@pytest.mark.parametrize("n_boards", [2, 12])
def test_names_of_narrow_boards(n_boards):
    """What stands above each other is named once, from the top down; two tables that cross are not above each other."""
    boards = [f"upper_board_{i:02}" for i in range(n_boards)]
    bodies = [
        f'<body name="{b}" pos="0 0 {0.3 + 0.15 * i}"><geom type="box" size=".1 .2 .01"/></body>'
        for i, b in enumerate(boards)
    ]
    bodies += [
        f'<body name="{name}" pos="{x} 0 {z}" euler="0 0 {yaw}"><geom type="box" size=".3 .1 .01"/></body>'
        for name, x, z, yaw in (("flat", 0.6, 0.3, 0), ("aslant", 0.9, 0.5, 60))
    ]
    scene = f"<mujoco><worldbody>{''.join(bodies)}</worldbody></mujoco>"
    a = mja.Arena.from_xml(scene, [*boards, "flat", "aslant"], objects=[mja.Object("cube")])
    names = names_apart(a.plan(a.nominal_params()))
    assert len(names) == 3 + 2
    assert {"flat", "aslant"} < set(names)
    assert " over ".join(boards[::-1]) in [" ".join(name.split()) for name in names]


def test_map_holds_what_is_drawn():
    """A robot and a wall beside the tables are not cut off; a floor that reaches around everything is not drawn, as planes are not."""
    robot = """<mujoco><worldbody><body name="arm"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 .7 -.75 .1 .7" size=".05"/></body>
      <geom type="cylinder" size=".1 .3" pos="0 0 .3"/><geom type="box" size=".1 2 1" pos="-2 0 1"/></worldbody></mujoco>"""
    floor = """<mujoco><worldbody><geom type="box" size="20 20 .1" pos="0 0 -.1"/><geom type="box" size="9 9 .01" pos="0 0 -.01"/>
      </worldbody></mujoco>"""
    a = mja.TableArena(xml=floor, objects=[mja.Object("cube")])
    a.attach(robot, "r_", pos=(-1.2, 0, 0))
    axes = a.plan(a.nominal_params()).axes[0]
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    drawn = np.concatenate([p.get_xy() for p in axes.patches if isinstance(p, Polygon)])
    assert (drawn > [left, low]).all()
    assert (drawn < [right, high]).all()
    assert len(polygons(axes.figure, 4)) == 3
    np.testing.assert_allclose(drawn.min(0), [-3.3, -2], atol=1e-6)  # the wall
    assert right < 1


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
