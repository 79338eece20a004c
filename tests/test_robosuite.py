"""robosuite's two arenas, as compiled by robosuite 1.5.2: the same world poses, sizes, frictions, masks and attributes."""

import json
import pathlib
import warnings

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.params.params import named

DATA = pathlib.Path(__file__).parent / "data"

# The seeds' three tables and, with its default arguments, its one.
MULTI = {
    "table_offsets": [[-0.3, 0.0, 0.8], [0.3, 0.0, 0.9], [0.0, 0.5, 0.8]],
    "table_rots": [0, np.pi / 4, 0],
    "table_full_sizes": [(0.8, 0.8, 0.05), (0.5, 0.5, 0.05), (0.6, 0.6, 0.05)],
    "has_legs": [True, True, False],
}


def multi():
    with pytest.warns(UserWarning, match="Tables 'table0' and 'table2' overlap by 0.2 m horizontally and 0.05 m"):
        return mja.MultiTableArena(**MULTI)


def multi_elsewhere():
    """Another template of the same topology, brought to the same world by `apply`."""
    arena = mja.MultiTableArena(
        np.add(np.multiply(MULTI["table_offsets"], 3), [0, 0, -1.2]), 0.3, (0.3, 0.4, 0.1), has_legs=True
    )
    params = arena.nominal_params()._replace(
        table_offsets=np.array(MULTI["table_offsets"]),
        table_rots=np.array(MULTI["table_rots"]),
        table_full_sizes=np.array(MULTI["table_full_sizes"]),
        has_legs=np.array(MULTI["has_legs"]),
    )
    model = arena.apply(arena.put_model("jax"), params)
    changed = arena.mj_model
    for name in arena.fields(model, params):
        if not name.startswith("stat"):
            getattr(changed, name)[...] = np.asarray(getattr(model, name)).reshape(getattr(changed, name).shape)
    changed.geom_sameframe[...] = 0  # C MuJoCo's shortcut, compiled for the template
    return changed


def example(name):
    """The example that comes with the package, with its objects."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*Tables 'table0' and 'table2' overlap by 0.2 m horizontally")
        return mja.load(name)[0].mj_model


CASES = {
    "multi": ("robosuite_multi_table_example.json", lambda: multi().mj_model),
    "multi, applied to another template": ("robosuite_multi_table_example.json", multi_elsewhere),
    "multi, shipped as a file": ("robosuite_multi_table_example.json", lambda: example("robosuite_multi_table")),
    "one": ("robosuite_table_example.json", lambda: mja.TableArena().mj_model),
    "one, shipped as a file": ("robosuite_table_example.json", lambda: example("robosuite_table")),
}


@pytest.mark.parametrize("case", CASES)
def test_robosuite_oracle(case):
    """World poses, sizes, frictions, groups, contact masks and sites within 1e-6."""
    file, build = CASES[case]
    expected = json.loads((DATA / file).read_text())
    model = build()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)

    tables = [g for g in expected["geoms"] if g["name"].startswith("table")] + [
        g for g in expected["geoms"] if g["name"] == "floor"
    ]
    assert len(tables) == {"multi": 15, "one": 7}[case.split(",")[0]]
    for want in tables:
        geom = model.geom(want["name"])
        near = {"rtol": 0, "atol": 1e-6, "err_msg": want["name"]}
        np.testing.assert_allclose(data.geom(want["name"]).xpos, want["xpos"], **near)
        np.testing.assert_allclose(geom.size, want["size"], **near)
        np.testing.assert_allclose(geom.friction, want["friction"], **near)
        np.testing.assert_allclose(geom.solref, want["solref"], **near)
        np.testing.assert_allclose(geom.solimp, want["solimp"], **near)
        np.testing.assert_allclose([geom.margin[0], geom.gap[0]], [want["margin"], want["gap"]], **near)
        turned = np.zeros(9)
        mujoco.mju_quat2Mat(turned, np.array(want["xquat"]))
        same = slice(2, None, 3) if "leg" in want["name"] else slice(None)  # a leg is round: only its axis counts
        np.testing.assert_allclose(data.geom(want["name"]).xmat[same], turned[same], **near)
        for mask in ("group", "contype", "conaffinity", "condim"):
            assert getattr(geom, mask)[0] == want[mask], (want["name"], mask)
        assert str(mujoco.mjtGeom(geom.type[0])).split(".")[-1] == want["type"]
    for want in expected["sites"]:
        np.testing.assert_allclose(data.site(want["name"]).xpos, want["xpos"], rtol=0, atol=1e-6)
        np.testing.assert_allclose(model.site(want["name"]).size, want["size"], rtol=0, atol=1e-6)
    for want in expected["cameras"]:
        camera = model.camera(want["name"])
        np.testing.assert_allclose(camera.pos, want["pos"], rtol=0, atol=1e-6)
        np.testing.assert_allclose(camera.quat, want["quat"], rtol=0, atol=1e-6)
        assert camera.fovy[0] == want["fovy"]

    # Deliberate differences: extra legs are hidden, the tables' friction takes effect, the slab that collides is not drawn.
    ours = {model.geom(g).name for g in range(model.ngeom)}
    hidden = ours - {g["name"] for g in tables} - {"cube_g0", "ball_g0"}  # objects of the shipped files
    assert hidden == ({f"table2_leg{k}_visual" for k in range(4)} if "multi" in case else set())
    assert all(model.geom(name).rgba[3] == 0 for name in hidden)
    assert {model.geom(n).priority[0] for n in ours if n.endswith("collision")} == {1}


def test_attributes_of_multi_table_arena():
    """The Python attributes hold robosuite's numbers."""
    expected = json.loads((DATA / CASES["multi"][0]).read_text())["arena_attrs"]
    arena = multi()
    for name in (
        "n_tables",
        "table_offsets",
        "table_full_sizes",
        "table_half_sizes",
        "table_rots",
        "table_frictions",
        "center_pos",
    ):
        np.testing.assert_allclose(getattr(arena, name), expected[name], rtol=0, atol=1e-6, err_msg=name)
    assert arena.has_legs == expected["has_legs"]
    np.testing.assert_array_equal(arena.bottom_pos, expected["bottom_pos"])
    np.testing.assert_allclose(arena.table_top_abs, expected["table_offsets"])


def test_attributes_of_table_arena():
    """The Python attributes hold robosuite's numbers, and its elements are the spec's."""
    expected = json.loads((DATA / CASES["one"][0]).read_text())["arena_attrs"]
    arena = mja.TableArena()
    for name in ("table_full_size", "table_half_size", "table_friction", "table_offset", "center_pos", "table_top_abs"):
        np.testing.assert_allclose(getattr(arena, name), expected[name], rtol=0, atol=1e-6, err_msg=name)
    assert arena.has_legs is expected["has_legs"]
    assert isinstance(arena.table_friction, tuple)
    assert isinstance(arena.table_offset, tuple)
    assert [e.name for e in (arena.table_body, arena.table_collision, arena.table_visual, arena.table_top)] == [
        "table",
        "table_collision",
        "table_visual",
        "table_top",
    ]


def test_legless_table():
    """robosuite's hidden legs: at the body's centre, 0.1 mm, transparent red."""
    model = mja.TableArena(has_legs=False).mj_model
    for k in range(1, 5):
        leg = model.geom(f"table_leg{k}_visual")
        np.testing.assert_allclose(leg.pos, 0)
        np.testing.assert_allclose(leg.size, [0.0001, 0.0001, 0])
        np.testing.assert_allclose(leg.rgba, [1, 0, 0, 0])


@pytest.mark.parametrize(("full", "leg"), [((0.4, 0.41, 0.05), (0.0, 0.105)), ((0.8, 0.3, 0.05), (0.3, 0.0))])
def test_leg_inset(full, leg):
    """A leg stands 0.1 m inside an edge of a slab wider than 0.4 m, else on its axis; x and y decide apart."""
    model = mja.TableArena(table_full_size=full).mj_model
    np.testing.assert_allclose(model.geom("table_leg1_visual").pos[:2], leg, atol=1e-12)
    np.testing.assert_allclose(model.geom("table_leg3_visual").pos[:2], np.negative(leg), atol=1e-12)


def test_other_methods():
    """One sentence says what stands for what is robosuite's alone; all else is as Python says."""
    arena = mja.TableArena()
    with pytest.raises(AttributeError) as raised:
        arena.set_camera("agentview", pos=(0, 0, 1))
    assert str(raised.value) == (
        "'TableArena' has no 'set_camera': add_camera(name, ...) for a new one, `spec.camera(name)` to change one."
    )
    with pytest.raises(AttributeError, match=r"^'TableArena' has no 'set_friction'\.$"):
        arena.set_friction(1)
    assert not hasattr(arena, "configure_location")


def test_errors_in_properties_are_told():
    """What something inside of a property lacks is told, and not that the arena lacks the property."""

    class Own(mja.TableArena):
        @property
        def broken(self):
            return None.sizes

    with pytest.raises(AttributeError, match=r"^'NoneType' object has no attribute 'sizes'"):
        _ = Own().broken


def test_usage_examples_of_multi_table_arena(capsys):
    """The seed's examples, as written but for the import."""
    from mjx_arenas import MultiTableArena

    # Create a workspace with two tables side by side
    arena = MultiTableArena(
        table_offsets=np.array([
            [0.0, -0.5, 0.8],  # Left table
            [0.0, 0.5, 0.8],  # Right table
        ]),
        table_full_sizes=(0.6, 0.6, 0.05),
        table_frictions=(1.0, 0.005, 0.0001),
        has_legs=True,
    )  # fmt: skip
    assert arena.n_tables == 2

    # Create a workspace with tables of different sizes and rotations
    with pytest.warns(UserWarning, match="overlap"):
        arena = MultiTableArena(
            table_offsets=np.array([
                [-0.3, 0.0, 0.8],
                [0.3, 0.0, 0.9],
                [0.0, 0.5, 0.8],
            ]),
            table_rots=[0, np.pi / 4, 0],
            table_full_sizes=[
                (0.8, 0.8, 0.05),
                (0.5, 0.5, 0.05),
                (0.6, 0.6, 0.05),
            ],
            has_legs=[True, True, False],
        )  # fmt: skip

    # Access table properties
    print("Number of tables:", arena.n_tables)
    print("Table centers:", arena.center_pos)
    print("Table half sizes:", arena.table_half_sizes)
    assert capsys.readouterr().out.startswith("Number of tables: 3\nTable centers: [[-0.3    0.     0.775]")


def test_usage_examples_of_table_arena(capsys):
    """The seed's examples, as written but for the imports."""
    from mjx_arenas import TableArena

    # Create a standard table arena
    arena = TableArena(
        table_full_size=(0.8, 0.8, 0.05),
        table_friction=(1, 0.005, 0.0001),
        table_offset=(0, 0, 0.8),
        has_legs=True,
    )

    # Get the table top position for placing objects
    table_top = arena.table_top_abs
    print("Table top at:", table_top)
    assert capsys.readouterr().out == "Table top at: [0.  0.  0.8]\n"

    # Create a smaller legless table (e.g., for gripper testing)
    small_arena = TableArena(
        table_full_size=(0.4, 0.4, 0.1),
        table_offset=(0, 0, 0.1),
        has_legs=False,
    )
    assert small_arena.mj_model.body("table").pos[2] == pytest.approx(0.05)

    # Merge the arena into a world
    from mjx_arenas import MujocoWorldBase

    world = MujocoWorldBase()
    world.merge(arena)
    assert world.mj_model.geom("table_collision").size[0] == pytest.approx(0.4)
    assert world.mj_model.opt.impratio == 20
    with pytest.raises(ValueError, match="already has an arena"):
        world.merge(small_arena)


def test_empty_world():
    """What robosuite's has and this one has not is answered by what stands for it, and so is what is no arena."""
    world = mja.MujocoWorldBase()
    with pytest.raises(
        AttributeError, match=r"^'MujocoWorldBase' has no 'get_model': `mj_model` is the nominal arena's"
    ):
        world.get_model  # noqa: B018
    for given in ("arm.xml", [mja.TableArena()]):
        with pytest.raises(TypeError, match=r"^`arena` must be an arena; robots .* by arena.attach\(\.\.\.\), got "):
            world.merge(given)
    with pytest.raises(AttributeError, match=r"^'TableArena' has no 'set_scale': give `table_full_size` or"):
        mja.TableArena().set_scale(1.1)


def test_friction_rule():
    """`table_priority=0` is MuJoCo's rule: the larger friction of the two."""
    objects = [mja.Object("cube", friction=(0.5, 0.005, 0.0001))]
    for priority, expected in ((1, 0.1), (0, 0.5)):
        arena = mja.TableArena(table_friction=(0.1, 0.005, 0.0001), objects=objects, table_priority=priority)
        data = mujoco.MjData(arena.mj_model)
        mujoco.mj_step(arena.mj_model, data, nstep=50)
        assert data.ncon > 0
        np.testing.assert_allclose([contact.friction[0] for contact in data.contact], expected)


def test_gradient_type():
    """Nominal parameters are JAX arrays of JAX's default precision, and bool."""
    params = mja.TableArena().nominal_params()
    assert [p.dtype.name for p in named(params).values()] == [
        *["float32"] * 4,
        *["bool"] * 2,
        *["float32"] * 4,
        *["int32", "bool"],
    ]
    assert all(isinstance(p, jax.Array) for p in named(params).values())
