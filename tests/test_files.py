"""Files: what they say is what Python's calls say; they come back as they were; each mistake is one sentence."""

import json
import pathlib
import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from command import write

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.files import paths
from mjx_arenas.files import schema as file_calls
from mjx_arenas.spec import specs

EXAMPLES = sorted(file.stem for file in paths.EXAMPLES.glob("*.yaml"))
DATA = pathlib.Path(__file__).parent / "data"
ROBOT = '<mujoco><worldbody><body name="base" pos="0 0 .3"><joint/><geom size=".05 .2" type="capsule"/></body></worldbody></mujoco>'
DESK = """<mujoco>
  <worldbody>
    <body name="desk" pos="0 0 .7"><geom type="box" size=".5 .5 .02"/></body>
  </worldbody>
</mujoco>
"""
OVERLAP = "ignore:.*Tables 'table0' and 'table2' overlap by 0.2 m horizontally"


def same(one, other):
    """The same arena, by its MJCF, and equal ranges."""
    (arena, ranges), (again, again_ranges) = one, other
    assert again.spec.to_xml() == arena.spec.to_xml()
    assert [type(a) for a in again_ranges] == [type(a) for a in ranges]
    assert jax.tree.structure(again_ranges) == jax.tree.structure(ranges)
    for value, again_value in zip(jax.tree.leaves(ranges), jax.tree.leaves(again_ranges), strict=True):
        kind = getattr(value, "dtype", float)  # what was given in single precision is written with its digits
        assert np.array_equal(np.asarray(again_value, kind), value)
    return True


def test_load_is_python(tmp_path):
    """A file gives what the same calls in Python give; YAML 1.2's numbers and words are what they look like."""
    (tmp_path / "robots").mkdir()
    write(tmp_path / "robots", ROBOT, "robot.xml")
    file = write(
        tmp_path,
        """
        arena:
          type: MultiTableArena
          table_offsets: [[0, -0.6, 8e-1], [0, 0.6, 0.8]]
          objects:
            - no
            - {name: ball, type: sphere, full_size: 6e-2, on: 1}
          then:
            - attach: {robot: robots/robot.xml, prefix: arm_, on: 0}
        ranges:
          table_offsets: {Uniform: {low: [0, 0, -0.2], high: [0, 0, 0.2], relative: add, tied: [true, true, false]}}
          table_rots: {Uniform: [-0.5, 0.5]}
          has_legs: {Bernoulli: 0.5}
          object_tables: {Choice: [0, 1]}
          object_active: {Count: [1, 2]}
        """,
    )
    arena = mja.MultiTableArena(
        [[0, -0.6, 0.8], [0, 0.6, 0.8]], objects=[mja.Object("no"), mja.Object("ball", "sphere", 0.06, on=1)]
    )
    arena.attach(ROBOT, "arm_", on=0)
    ranges = mja.ArenaRanges(
        table_offsets=mja.Uniform([0, 0, -0.2], [0, 0, 0.2], "add", tied=(True, True, False)),
        table_rots=mja.Uniform(-0.5, 0.5),
        has_legs=mja.Bernoulli(0.5),
        object_tables=mja.Choice([0, 1]),
        object_active=mja.Count(1, 2),
    )
    assert same((arena, ranges), mja.load(file))


@pytest.mark.slow
@pytest.mark.filterwarnings(OVERLAP)
@pytest.mark.parametrize("suffix", [".yaml", ".json"])
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_come_back(name, suffix, tmp_path):
    """Each example loads by its name, can be sampled, and is the same when it was saved and loaded again."""
    arena, ranges = mja.load(name)
    assert ranges.varying
    file = tmp_path / f"again{suffix}"
    mja.save(file, arena, ranges)
    assert same((arena, ranges), mja.load(file))
    assert [f.name for f in tmp_path.iterdir()] == [file.name]


def everything(folder):
    """An arena and ranges with every kind of call and of value."""
    write(folder, DESK, "desk.xml")
    write(folder, ROBOT, "robot.xml")
    write(folder, "<mujoco><worldbody><body><geom size='.02'/></body></worldbody></mujoco>", "thing.xml")
    objects = [
        mja.Object("wedge", "mesh", 0.1, file=DATA / "wedge.obj", pos=np.array([0.2, 0.2])),
        mja.Object("thing", "mjcf", file=folder / "thing.xml"),
    ]
    arena = mja.Arena.from_xml(folder / "desk.xml", ["desk"], objects=objects, table_priority=0)
    arena.attach(folder / "robot.xml", "one_", pos=np.array([0.1, 0, 0]), on="desk")
    other = mja.TableArena(np.float32([0.6, 0.7, 0.05]), table_offset=jnp.array([0, 0, 0.9]), xml=DESK)
    other.attach(ROBOT)
    arena = arena.merge(other, "b_", pos=(2, 0, 0), rot=0.1)
    arena.attach(ROBOT, "last_", on=1)
    kinds = {
        "table_offsets": mja.Normal(0.0, 0.01, -0.02, jnp.float32(0.02), "add", tied="axes"),
        "table_rots": mja.Uniform([0, -0.1], [0, 0.1]),
        "table_frictions": mja.LogUniform([0.1, 0.005, 0.0001], [1, 0.005, 0.0001], tied=True),
        "table_full_sizes": mja.Fixed([0.9, 0.9, 0.04]),
        "object_tables": mja.Choice([0, 1], p=[[0.5, 0.5], [0.25, 0.75]]),
        "object_active": mja.Count(1, 2),
        "object_rgba": mja.Choice([[1, 0, 0, 1], [0, 0, 1, 1]]),
        "object_masses": mja.Fixed(0.1),
        "has_legs": mja.Bernoulli(0),
        "workspace": mja.Workspace([-2, -2], [3, 2], gap=0.05),
    }
    assert {type(d) for d in kinds.values()} == {*mja.Distribution.__subclasses__(), mja.Workspace}
    return arena, mja.ArenaRanges(**kinds)


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_everything_comes_back(suffix, tmp_path, monkeypatch):
    """Robots, merged arenas, scenes, files, every distribution, arrays of any kind; from any working directory."""
    folder = tmp_path / "here"
    folder.mkdir()
    configured = everything(folder)
    monkeypatch.chdir(DATA)
    file = folder / f"arena{suffix}"
    mja.save(file, *configured)
    assert same(configured, mja.load(file))
    text = file.read_text()
    assert "0.02" in text
    assert "0199999" not in text  # the digits of single precision
    assert str(folder) not in text  # its own folder's files are named relative to it
    moved = folder.rename(tmp_path / "there")
    assert same(configured, mja.load(moved / file.name))


def test_arguments_are_not_shared():
    """What an arena was made of does not change with the list that it was made of."""
    offsets = np.array([[0, 0, 0.8]])
    arena = mja.MultiTableArena(offsets)
    offsets[:] = 5
    assert arena.calls[0].arguments == {"table_offsets": [[0, 0, 0.8]]}


@pytest.mark.parametrize("suffix", [".yaml", ".json"])
def test_options_come_back(suffix, tmp_path):
    """Those of the spec and those that were set on the compiled model, of merged arenas, too, to the last digit."""
    one, other, file = mja.TableArena(), mja.TableArena(), tmp_path / f"arena{suffix}"
    one.spec.option.tolerance = 1 / 3e9
    other.mj_model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    arena = one.merge(other, "b_", (3, 0, 0))
    arena.mj_model.opt.gravity[:], arena.mj_model.opt.timestep = (0.1, 0, -1 / 3), 0.001
    mja.save(file, arena)
    again = mja.load(file)[0]
    assert specs.options(again.mj_model.opt) == specs.options(arena.mj_model.opt)
    assert again.record == arena.record
    mja.save(file, again)
    assert specs.options(mja.load(file)[0].spec.option) == specs.options(arena.mj_model.opt)


def edited():
    arena = mja.TableArena()
    arena.spec.worldbody.add_site(name="mine")
    return arena


def unheld():
    """A name that XML does not give back."""
    arena = mja.TableArena()
    arena.spec.worldbody.add_site(name="two\nlines", size=[0.01, 0, 0])
    return arena


@pytest.mark.parametrize("name", [pytest.param("workshop", marks=pytest.mark.slow), "pick_and_place"])
def test_edits_come_back(name, tmp_path):
    """What was added in Python, to tables, too, is in an MJCF beside the file; worlds are the same, to rounding, and again."""
    arena, ranges = mja.load(name)
    top = arena.spec.body(arena.table_names[0])
    top.add_geom(name="knob", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0], pos=[0.1, 0.1, 1 / 3])
    top.add_site(name="here", pos=[0.1, 0.2, 0.3])
    arena.spec.worldbody.add_camera(name="mine", pos=[1, 0, 1.23456789])
    arena.spec.option.timestep = 1 / 700
    for text in (None, '"here"'):
        mja.save(tmp_path / "arena.yaml", arena, ranges)
        xml = (tmp_path / "arena_spec" / "spec.xml").read_text()
        assert text is None or text in xml
        again, same_ranges = mja.load(tmp_path / "arena.yaml")
        params = [
            jax.tree.map(np.asarray, a.sample_params(jax.random.key(3), r))
            for a, r in ((arena, ranges), (again, same_ranges))
        ]
        jax.tree.map(np.testing.assert_array_equal, *params)
        one, other = arena.compile(params[0]), again.compile(params[1])
        assert one.names == other.names
        for field in ("geom_pos", "geom_size", "body_mass", "site_pos", "site_size", "cam_pos", "body_invweight0"):
            a, b = getattr(one, field), getattr(other, field)
            np.testing.assert_allclose(b, a, rtol=0, atol=1e-12 * np.abs(a).max(), err_msg=field)
        assert other.opt.timestep == 1 / 700
        arena, ranges = again, same_ranges


SERVO = """<mujoco><worldbody><body name="b"><joint name="j" axis="0 1 0"/><geom name="g" size=".1" pos=".2 0 0" mass="1"/></body>
</worldbody><actuator><motor joint="j"/><position name="p" joint="j" kp="10" dampratio="1"/></actuator></mujoco>"""


@pytest.mark.parametrize("how", ["given", "edited"])
def test_a_dampratio_comes_back(how, tmp_path):
    """It is in the MJCF as a ratio, though MuJoCo writes the damping there: in worlds with another gain the damping is another."""
    arena = mja.Arena.from_xml(mujoco.MjSpec.from_string(SERVO) if how == "given" else SERVO)
    if how == "edited":
        arena.spec.worldbody.add_site(name="mine")
    arena.vary(kp=dr.Term("actuator.kp", "p"))
    mja.save(tmp_path / "arena.yaml", arena)
    dampings = []
    for one in (arena, mja.load(tmp_path / "arena.yaml")[0]):
        nominal = jax.tree.map(np.asarray, one.nominal_params())
        made = one.compile(nominal._replace(terms={"kp": nominal.terms["kp"] * 4}))
        dampings.append(made.actuator_biasprm[1, 2] / one.mj_model.actuator_biasprm[1, 2])
    np.testing.assert_allclose(dampings, 2, rtol=1e-12)


@pytest.mark.parametrize("attribute", ["geom.pos", "body.payload", "geom.size"])
def test_a_term_is_no_edit(attribute, tmp_path):
    """What `vary` writes into the spec, also where the arena is compiled, is not written beside the file."""
    arena = mja.Arena.from_xml(SERVO)
    arena.vary(x=dr.Term(attribute, "b" if attribute.startswith("body") else "g"))
    assert arena.mj_model
    mja.save(tmp_path / "arena.yaml", arena)
    assert [path.name for path in tmp_path.iterdir()] == ["arena.yaml"]


def test_edits_with_files_come_back(tmp_path):
    """Assets of an edit are copied beside, so that the folder can be moved."""
    arena = mja.TableArena()
    arena.spec.add_mesh(name="wedge", file=str(DATA / "wedge.obj"))
    arena.spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="wedge", pos=[3, 0, 0])
    (tmp_path / "here").mkdir()
    mja.save(tmp_path / "here" / "arena.json", arena)
    moved = (tmp_path / "here").rename(tmp_path / "there")
    again, _ = mja.load(moved / "arena.json")
    np.testing.assert_array_equal(again.mj_model.mesh_vert, arena.mj_model.mesh_vert)
    assert str(tmp_path) not in (moved / "arena_spec" / "spec.xml").read_text()


def with_specs():
    """A robot with a mesh and a number of many digits, and an object, both given as specs."""
    robot = mujoco.MjSpec.from_string(ROBOT)
    robot.add_mesh(name="wedge", file=str(DATA / "wedge.obj"))
    robot.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="wedge", pos=[1 / 3, 0, 0])
    cup = mujoco.MjSpec.from_string('<mujoco><worldbody><body><geom size=".03"/></body></worldbody></mujoco>')
    arena = mja.TableArena(objects=[mja.Object("cup", "mjcf", file=cup)])
    arena.attach(robot, "r_", pos=(0, 2, 0))
    return arena


@pytest.mark.parametrize("edit", [False, True])
def test_given_specs_come_back(edit, tmp_path):
    """They are beside the file with their meshes, so that the folder can be moved; the model is the same, and so is one that was edited."""
    arena = with_specs()
    if edit:
        arena.spec.worldbody.add_site(name="mine")
    (tmp_path / "here").mkdir()
    mja.save(tmp_path / "here" / "arena.yaml", arena)
    moved = (tmp_path / "here").rename(tmp_path / "there")
    assert (moved / "arena_spec").exists() == edit
    again, _ = mja.load(moved / "arena.yaml")
    one, other = arena.mj_model, again.mj_model
    assert one.names == other.names
    for field in (
        "geom_pos",
        "geom_size",
        "mesh_vert",
        "body_mass",
        "body_inertia",
        "jnt_range",
        "actuator_gainprm",
        "qpos0",
    ):
        np.testing.assert_allclose(getattr(other, field), getattr(one, field), rtol=1e-12, err_msg=field)
    assert str(tmp_path) not in (moved / "arena_given0" / "spec.xml").read_text()
    mja.save(moved / "arena.yaml", again)  # over itself
    assert mja.load(moved / "arena.yaml")[0].mj_model.names == one.names


def test_an_edit_that_is_undone(tmp_path):
    """A file without an edit says nothing of a spec, though one is there from before."""
    mja.save(tmp_path / "arena.yaml", edited())
    assert "spec: arena_spec/spec.xml" in (tmp_path / "arena.yaml").read_text()
    mja.save(tmp_path / "arena.yaml", mja.TableArena())
    assert "spec" not in (tmp_path / "arena.yaml").read_text()


EDITED = (
    "`arena` is not what its arguments make, since `arena.spec` was edited or one of its files has changed, and MJCF does not "
    "hold the edit: make it in an MJCF file, and give that as `xml` or to `attach`."
)
UNSAVED = {
    "edited": (ValueError, unheld, None, EDITED),
    "made by hand": (
        ValueError,
        lambda: mja.Arena(mja.TableArena().spec, mja.TableArena()._parts, mja.TableArena()._nominal),
        None,
        "`arena` was not made by MultiTableArena, TableArena or Arena.from_xml: its spec cannot be written.",
    ),
    "no arena": (TypeError, lambda: None, None, "`arena` must be an arena, got NoneType."),
    "no ranges": (TypeError, mja.TableArena, {}, "`ranges` must be an mjx_arenas.ArenaRanges, got dict."),
    "wrong ranges": (
        ValueError,
        mja.TableArena,
        mja.ArenaRanges(table_rots=mja.Uniform(1, 0)),
        "`ranges.table_rots` (Uniform): `low` must be <= `high`, got 1 and 0.",
    ),
}


@pytest.mark.parametrize("case", UNSAVED)
def test_what_cannot_be_saved(case, tmp_path):
    """One sentence, and what was in the file stays."""
    kind, arena, ranges, message = UNSAVED[case]
    file = write(tmp_path, "as before")
    with pytest.raises(kind) as error:
        mja.save(file, arena(), ranges)
    assert str(error.value) == message
    assert file.read_text() == "as before"


def test_schema_is_the_signatures(tmp_path, monkeypatch):
    """A new distribution is known to files as soon as there is one."""
    peak = type("Peak", (mja.Fixed,), {})  # not a direct subclass, or the other tests would know it, too
    monkeypatch.setattr(mja.Distribution, "__subclasses__", lambda: [peak], raising=False)
    reader = file_calls.Reader(tmp_path / "a.json", {})
    assert reader.ranges({"table_rots": {"Peak": 0.3}}).table_rots == peak(0.3)
    assert not reader.problems


def test_world_keys():
    """World i of a seed is one key, whichever worlds are asked for; another world or seed, another key."""
    data = jax.random.key_data
    keys = data(mja.world_keys(7, range(100)))
    assert np.array_equal(data(mja.world_keys(7, [5, 17])), keys[np.array([5, 17])])
    assert np.array_equal(keys[3], data(jax.random.fold_in(jax.random.key(7), 3)))
    assert len(np.unique(np.concatenate([keys, data(mja.world_keys(8, range(100)))]), axis=0)) == 200
    assert mja.world_keys(0, []).shape == (0,)
    with pytest.raises(
        ValueError, match=r"2 problems.*\n- `seed` must be .*got -1\.\n- `worlds` must be .*got \[-1\]\."
    ):
        mja.world_keys(-1, [-1])


def test_json_needs_no_yaml(tmp_path, monkeypatch):
    """JSON works without ruamel.yaml, and YAML says what is missing."""
    monkeypatch.setitem(sys.modules, "ruamel.yaml", None)
    file = tmp_path / "a.json"
    mja.save(file, mja.TableArena(has_legs=False))
    assert json.loads(file.read_text()) == {"arena": {"type": "TableArena", "has_legs": False}}
    assert mja.load(file)[0].has_legs is False
    with pytest.raises(ImportError, match=r"^YAML needs ruamel.yaml: pip install 'mjx_arenas\[cli\]', or use .json.$"):
        mja.load("shelf")


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_names_are_written(suffix, tmp_path):
    """Numbers of surfaces and variants, which adding a part shifts, are names in files; what is no such number stays."""
    cups = [mja.Object("small", full_size=0.04), mja.Object("large", full_size=0.06)]
    arena = mja.TableArena(objects=[mja.Object("cup", variants=cups)])
    arena.add_part(furniture.Shelf("rack", pos=(2, 0, 0)))
    given = {
        "alone": (mja.Choice([0, 2]), mja.Choice([1, 0])),
        "weighed": (mja.Choice([1, 0], p=[0.25, 0.75]), mja.Choice([0, 1], p=[1, 0])),
        "given": (mja.Fixed(2), mja.Fixed(1.0)),
    }
    for case, (tables, variants) in given.items():
        ranges = mja.ArenaRanges(object_tables=tables, terms={"cup.variant": variants})
        file = tmp_path / f"{case}.{suffix}"
        mja.save(file, arena, ranges)
        text = file.read_text().rpartition("ranges")[2]
        assert {"alone": "rack_board1", "weighed": "rack_board0", "given": "rack_board1"}[case] in text
        assert {"alone": "small", "weighed": "small", "given": "large"}[case] in text
        assert mja.load(file)[1] == ranges
        assert ("0.25" in text) == (case == "weighed")


def test_names_of_options(tmp_path):
    """As in MJCF, in any case, or their numbers."""
    file = tmp_path / "arena.yaml"
    file.write_text("arena: {type: TableArena, options: {cone: elliptic, solver: CG, integrator: 1}}\n")
    option = mja.load(file)[0].spec.option
    assert option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert option.solver == mujoco.mjtSolver.mjSOL_CG
    assert option.integrator == mujoco.mjtIntegrator.mjINT_RK4
