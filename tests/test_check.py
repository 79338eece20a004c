"""Scenes made to break are caught, for the right cause, and break in C MuJoCo again; healthy ones are not."""

import dataclasses
import functools
import json
import os
import shutil
import warnings

import jax
import mujoco
import numpy as np
import pytest
import worlds

import mjx_arenas as mja
from mjx_arenas import cli, dr
from mjx_arenas.checks import causes, engines, watch, watch_c
from mjx_arenas.checks import failures as failures_

pytestmark = pytest.mark.filterwarnings("ignore:.*Object 'foil'. `mass` is")
TURNED = mja.ArenaRanges(table_rots=mja.Uniform(-1, 1))
THICK = 1.5e-4  # of the foil [m]: with MuJoCo's default softness it comes to rest 0.108 mm deep
UNSTABLE = """
<mujoco>
  <worldbody>
    <body name="spring" pos="0 2 1">
      <joint name="slide" type="slide" axis="0 0 1" stiffness="-1e4"/>
      <geom size="0.05" mass="1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>"""
FOIL = """
arena:
  type: TableArena
  objects:
    - {name: foil, full_size: [0.2, 0.2, 0.0002], mass: 100}
ranges:
  table_rots: {Uniform: [-1, 1]}
"""


@pytest.fixture(scope="module")
def foil():
    """A heavy foil that sinks into its table, beside a cube that does not."""
    return mja.TableArena(objects=[mja.Object("foil", "box", (0.2, 0.2, THICK), mass=100), mja.Object("cube")])


@pytest.fixture(scope="module")
def crowd():
    """Boxes that do not always fit on their table, whose size varies too much."""
    objects = [mja.Object(f"box{k}", "box", 0.15) for k in range(4)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mja.TableArena(objects=objects)


def middles(arena, report, world):
    """Heights of the middles of objects over their tables' tops in C MuJoCo, written anew: after each step, (S, K)."""
    key = mja.world_keys(report.seed, [world])[0]
    params = arena.sample_params(key, TURNED)
    model, c = arena.c_world(params, key=key)
    heights = []
    for _ in range(report.n_steps):
        mujoco.mj_step(model, c)
        heights.append([c.joint(f"{o.name}_joint0").qpos[2] - float(params.table_offsets[0, 2]) for o in arena.objects])
    return np.array(heights)


def test_healthy(arena, monkeypatch):
    """Nothing is wrong where objects rest on their tables, and nothing is kept of such worlds."""
    told = []
    monkeypatch.setattr(engines, "Run", None)
    report = mja.check(arena, worlds.RANGES, 3, n_steps=40, engine="c", progress=lambda *part: told.append(part))
    assert told == [(step, 40) for step in range(1, 41)]
    assert report.ok
    assert not report.failed.any()
    assert report.worst == ()
    assert str(report) == "Nothing is wrong in 3 worlds (seed 0, 40 steps or 0.08 s on C MuJoCo)."


@pytest.mark.slow
def test_through_the_table(foil, tmp_path):
    """The foil's middle sinks below the top, as a loop written anew sees; its bundle replays that to the number."""
    report = mja.check(foil, TURNED, worlds=[3, 7], n_steps=40, engine="c")
    heights = middles(foil, report, 7)
    through = report.of(7)["through_table"]
    assert through.step == np.flatnonzero(heights[:, 0] < 0)[0] + 1
    assert through.number == pytest.approx(-heights[:, 0].min(), rel=1e-6)
    assert set(report.failures) == {"through_table", "deep_penetration"}
    assert report.failed.all()
    assert all("foil" in f.what and "cube" not in f.what for found in report.failures.values() for f in found)
    # Its contacts are deeper than its middle by its half thickness.
    deep = report.of(7)["deep_penetration"]
    assert deep.number * THICK / 2 == pytest.approx(through.number + THICK / 2, rel=0.02)

    report.save_bundle(tmp_path / "bundle", 7)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.begins == "start"
    for cause, recorded in report.of(7).items():
        assert replay.found[cause].step == recorded.step
        assert replay.found[cause].number == pytest.approx(recorded.number, rel=1e-3)
    start, before, *_ = np.split(np.asarray(replay.picture(120, 90))[:, : 4 * 126], 4, axis=1)
    assert np.ptp(start[30:]) > 50
    with pytest.raises(ValueError, match=r"^`height` must be a whole number from 1 to 16384 \[pixels\], got 0\.$"):
        replay.picture(height=0)
    assert (start[:20] != before[:20]).any()  # their labels differ

    # The last good state is the one before the first step in which something is wrong.
    first = min(f.step for f in report.of(7).values())
    about = json.loads((tmp_path / "bundle" / "failure.json").read_text())
    assert about["good_step"] == first - 1
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "bundle" / "world.xml"))
    c, states = mujoco.MjData(model), np.load(tmp_path / "bundle" / "states.npz")
    c.qpos, c.qvel = states["start_qpos"], states["start_qvel"]
    mujoco.mj_step(model, c, nstep=first - 1)
    np.testing.assert_allclose(states["good_qpos"], c.qpos, atol=1e-9)


@pytest.mark.slow
def test_table_too_small(crowd, tmp_path):
    """Objects without a free place start above the others and fall; their bundle shows both in C."""
    ranges = mja.ArenaRanges(table_full_sizes=mja.Uniform([0.2, 0.2, 0.02], [0.5, 0.5, 0.05]))
    report = mja.check(crowd, ranges, 6, n_steps=300, engine="c")
    keys = mja.world_keys(0, range(6))
    params = jax.vmap(crowd.sample_params, in_axes=(0, None))(keys, ranges)
    placed = np.asarray(jax.vmap(crowd.place)(params, keys).valid)
    found = report.failures["invalid_placement"]
    assert {f.world for f in found} == set(np.flatnonzero(~placed.all(1)))
    assert f"worlds that fail: {', '.join(map(str, np.flatnonzero(report.failed)))}" in str(report).splitlines()
    assert [f.number for f in found] == sorted((~placed).sum(1)[[f.world for f in found]], reverse=True)
    assert "off_table" in report.failures
    report.save_bundle(tmp_path / "bundle", found[0].world)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.found["invalid_placement"].number == found[0].number
    assert set(replay.found) == set(report.of(found[0].world))


def test_a_bundle_of_a_world_in_which_nothing_is_wrong(tmp_path):
    report = mja.check(mja.TableArena(objects=[mja.Object("cube")]), TURNED, worlds=[4], n_steps=1, engine="c")
    with pytest.raises(ValueError, match=r"^`world` must be one that fails, got 4, in which nothing is wrong\.$"):
        report.save_bundle(tmp_path / "bundle", 4)
    assert not (tmp_path / "bundle").exists()


@pytest.mark.slow
def test_impossible_arenas(crowd, tmp_path, monkeypatch):
    """Worlds that cannot be are reported with the reason, and stepped as MuJoCo compiles them; their bundles say it again."""
    ranges = mja.ArenaRanges(table_full_sizes=mja.Uniform([0.1, 0.1, 0.02], [0.11, 0.11, 0.05]))
    monkeypatch.setattr(failures_, "LOOKED_AT", 2)
    report = mja.check(crowd, ranges, 3, n_steps=5, engine="c")
    assert [f.world for f in report.failures["invalid_arena"]][-1] == 2
    assert report.of(2)["invalid_arena"].what == "Why is said of the first 2 such worlds only."
    assert set(report.failures) == {"invalid_arena", "invalid_placement"}
    assert "larger than table 0" in report.of(1)["invalid_arena"].what
    assert set(report.worst) == {0} | {found[0].world for found in report.failures.values()}
    report.save_bundle(tmp_path / "bundle", 1)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.found == report.of(1)
    assert "C MuJoCo, from its start: the same failure shows." in str(replay)
    plain = mujoco.MjModel.from_xml_path(str(tmp_path / "bundle" / "world.xml"))
    assert plain.key("state").qpos[2] > float(crowd.nominal_params().table_offsets[0, 2]) + 0.15


def never_stepped(arena, params, tmp_path):
    """The report of a world that cannot be stepped, and the replay of its bundle, which finds the reason again."""
    run = engines.Run(params, np.array([[0, 0, 0.9, 1.0, 0, 0, 0]]), {})
    failures = {"invalid_arena": (causes.invalid(arena.problems(params)),)}
    report = failures_.CheckReport(
        "c",
        "C MuJoCo",
        0,
        (0,),
        0,
        1,
        np.full(1, 0.002),
        failures,
        np.zeros(1, bool),
        (),
        arena.record,
        mja.ArenaRanges(),
        {0: run},
        None,
    )
    report.save_bundle(tmp_path / "bundle", 0)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.found["invalid_arena"] == report.of(0)["invalid_arena"]
    assert "The arena is invalid, so nothing was stepped. The same problem was found again." in str(replay)
    return replay


def test_what_mujoco_does_not_compile(tmp_path):
    """Its bundle has no MJCF, and the reason is found again."""
    arena = mja.TableArena(objects=[mja.Object("rod", "capsule", (0.2, 0.1, 0.1))])
    params = arena.nominal_params()._replace(object_full_sizes=np.array([[0.1, 0.2, 0.2]]))
    replay = never_stepped(arena, params, tmp_path)
    assert not (tmp_path / "bundle" / "world.xml").exists()
    assert "a capsule" in replay.found["invalid_arena"].what
    with pytest.raises(RuntimeError, match=r"^There is no picture of this world: MuJoCo does not compile it\.$"):
        replay.picture()


def test_wrong_parameters(tmp_path):
    """A world of such is not stepped, but its bundle has what MuJoCo compiles, and a picture of it."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    params = arena.nominal_params()._replace(object_frictions=np.array([[-1.0, 0.005, 0.0001]]))
    replay = never_stepped(arena, params, tmp_path)
    assert "object_frictions" in replay.found["invalid_arena"].what
    assert np.ptp(np.asarray(replay.picture(120, 90))[30:]) > 50
    plain = mujoco.MjModel.from_xml_path(str(tmp_path / "bundle" / "world.xml"))
    assert plain.key("state").qpos[2] == pytest.approx(0.9)


@pytest.mark.slow
def test_tables_out_of_their_workspace(tmp_path):
    """They are stepped, as MuJoCo compiles them; nothing goes wrong but that they cannot be."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("cube")])
    ranges = mja.ArenaRanges(workspace=mja.Workspace((0, 0), (0.9, 0.9)))
    report = mja.check(arena, ranges, 1, n_steps=2, engine="c")
    assert set(report.failures) == {"invalid_arena"}
    assert "is not inside the workspace, [0.0, 0.0] to [0.9, 0.9] m." in report.of(0)["invalid_arena"].what
    report.save_bundle(tmp_path / "bundle", 0)
    assert mja.replay(tmp_path / "bundle").found == report.of(0)


def test_tables_that_overlap(tmp_path):
    """They are found, stepped and said again by their bundle; those that overlap by intent are not found."""
    with pytest.warns(UserWarning, match="'table1' and 'table2' overlap"):
        arena = mja.MultiTableArena(
            [[0, 0, 0.8], [0, 1.2, 0.8], [0, 1.9, 0.8]], objects=[mja.Object("cube", pos=(0, 0))]
        )
    ranges = mja.ArenaRanges(table_offsets=mja.Fixed([[0, 0, 0], [0, -0.6, 0], [0, -0.6, 0]], relative="add"))
    report = mja.check(arena, ranges, 1, n_steps=2, engine="c")
    assert set(report.failures) == {"invalid_arena"}
    assert report.of(0)["invalid_arena"].what.startswith("Tables 0 and 1 overlap by 0.2 m horizontally and 0.05 m vert")
    report.save_bundle(tmp_path / "bundle", 0)
    assert mja.replay(tmp_path / "bundle").found == report.of(0)
    file = tmp_path / "bundle" / "failure.json"
    about = json.loads(file.read_text())
    assert about["rules"]["overlapping"] == [[1, 2]]
    about["rules"]["overlapping"] = []
    file.write_text(json.dumps(about))
    assert "Tables 1 and 2 overlap" in mja.replay(tmp_path / "bundle").found["invalid_arena"].what


BODIES = b"""<mujoco><worldbody><body name="foil"><freejoint/><geom size="1"/></body>
<body name="cube"><freejoint/><geom size="1"/></body></worldbody></mujoco>"""
DAMAGED = {
    "garbage": ("states.npz", b"half of it", "it is no .npz file"),
    "cut": ("states.npz", 300, ""),
    "another archive": ("states.npz", "npz", "'objects' is missing"),
    "no object": ("failure.json", b"[]", "it holds a list, not names and values"),
    "empty": ("failure.json", b"{}", "'bundle' is missing"),
    "newer": ("failure.json", b'{"bundle": 99}', "it is of version 99, this is for 2"),
    "no cause": ("failure.json", b'{"bundle": 2, "causes": {}}', "it has no cause of failure"),
    "kinds": ("failure.json", b'{"bundle": 2, "causes": {"off_table": 5}}', "its values are of other kinds"),
    "no JSON": ("params.json", b"{\n\n,", "it is no JSON in line 3"),
    "no text": ("params.json", b"\xff\xfe", "it is no text in UTF-8"),
    "no params": ("params.json", b'{"tables": [], "objects": []}', "'params' is missing"),
    "no MJCF": ("world.xml", b"thesis", "MuJoCo cannot read it"),
    "another world": ("world.xml", b"<mujoco/>", "it is of another world, without the object 'foil'"),
    "other joints": (
        "world.xml",
        BODIES.replace(b"freejoint", b"joint"),
        "of another world, without the object 'foil'",
    ),
    "other degrees": (
        "world.xml",
        BODIES.replace(b"</worldbody>", b"<body><joint/><geom size='1'/></body></worldbody>"),
        "has shape (14,), in world.xml it is (15,)",
    ),
}
# What of a JSON file is replaced, by what, and what is said of it.
EDITED = {
    "steps": ("failure.json", "n_steps", -5, "`n_steps` must be a whole number >= 0, got -5."),
    "good step": ("failure.json", "good_step", 13, "`good_step` must be a whole number from 0 to 12, the steps that"),
    "late": (
        "failure.json",
        "causes.deep_penetration.step",
        13,
        "`causes.deep_penetration.step` must be a whole number from 0",
    ),
    "half": ("failure.json", "n_steps", 12.5, "`n_steps` must be a whole number >= 0, got 12.5."),
    "center": ("failure.json", "center", [[0, 0, 0]], "`center` must have shape (2, 3), got (1, 3)."),
    "held": ("failure.json", "rules.held", {"99": "it is"}, "`rules.held` must be by numbers from 0 to 2, got 99."),
    "held by name": (
        "failure.json",
        "rules.held",
        {"foil": "it is"},
        "invalid literal for int() with base 10: 'foil'.",
    ),
    "space": (
        "failure.json",
        "rules.workspace",
        [1, 2, 0],
        "`rules.workspace`: `low` and `high` must be (x, y) with low <",
    ),
    "no space": ("failure.json", "rules.workspace", [], "its values are of other kinds."),
    "types": ("failure.json", "rules.types", ["box"], "`rules.types` must be of the 2 objects of params.json, got 1."),
    "sizes": ("failure.json", "rules.sizes", [0.1], "`rules.sizes` must have shape (2, 3), got (1,)."),
    "table": ("params.json", "params.object_tables", [0, 7], "`object_tables` must be from 0 to 0, got [0, 7]."),
    "tables": ("params.json", "params.table_rots", [0, 1], "`table_rots` must have shape (1,), got (2,)."),
}


@pytest.fixture(scope="module")
def kept(foil, tmp_path_factory):
    """A bundle."""
    folder = tmp_path_factory.mktemp("kept") / "bundle"
    mja.check(foil, TURNED, 1, n_steps=12, engine="c").save_bundle(folder, 0)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("case", DAMAGED)
def test_damaged_bundles(case, kept, tmp_path):
    """One sentence names the file and what is wrong with it."""
    name, content, why = DAMAGED[case]
    folder = shutil.copytree(kept, tmp_path / "bundle")
    if content == "npz":
        np.savez(folder / name, a=np.zeros(3))
    else:
        (folder / name).write_bytes((kept / name).read_bytes()[:content] if isinstance(content, int) else content)
    with pytest.raises(ValueError, match="is not what `check` wrote") as error:
        mja.replay(folder)
    said = str(error.value)
    assert "\n" not in said
    assert f"{name}' is not what" in said or "has shape" in said
    assert why in said
    assert "pickle" not in said


@pytest.mark.parametrize("case", EDITED)
def test_edited_bundles(case, kept, tmp_path):
    """What cannot be is said of the file in which it stands, before anything is stepped."""
    name, path, value, why = EDITED[case]
    folder = shutil.copytree(kept, tmp_path / "bundle")
    data = json.loads((folder / name).read_text())
    *outer, last = path.split(".")
    functools.reduce(dict.__getitem__, outer, data)[last] = value
    (folder / name).write_text(json.dumps(data))
    with pytest.raises(ValueError, match="is not what `check` wrote") as error:
        mja.replay(folder)
    assert str(error.value).startswith(f"{str(folder / name)!r} is not what `check` wrote: {why}")


@pytest.mark.slow
def test_numbers_of_numpy(foil, tmp_path):
    """The seed, and the worlds that `failed` picks, as NumPy has them; reports are compared as what they are, not element by element."""
    report = mja.check(foil, TURNED, worlds=np.array([2, 5]), seed=np.int64(1), n_steps=np.int64(12), engine="c")
    found = json.loads(json.dumps(report.to_dict()))
    assert (found["seed"], found["n_worlds"], found["n_failed"], found["n_steps"]) == (1, 2, 2, 12)
    report.save_bundle(tmp_path / "bundle", np.array(report.worlds)[report.failed][1])
    replay = mja.replay(tmp_path / "bundle")
    assert replay.to_dict()["world"] == 5
    for one in (report, replay):
        assert one == one
        assert one != dataclasses.replace(one)
        assert len({one, one}) == 1


def test_tops():
    """Of many worlds, as of each alone."""
    objects = [mja.Object("a", on=1), mja.Object("b", on=0), mja.Object("c", on=1)]
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.9]], objects=objects)
    ranges = worlds.TABLES._replace(table_active=mja.Bernoulli(0.5), object_tables=mja.Choice([0, 1]))
    params = jax.jit(jax.vmap(arena.sample_params, in_axes=(0, None)))(mja.world_keys(0, range(9)), ranges)
    got = watch.tops(jax.tree.map(np.asarray, params), np.zeros((3, 3)))
    for w, k in np.ndindex(9, 3):
        one = worlds.take(params, w)
        t = int(one.object_tables[k])
        np.testing.assert_array_equal(got.pos[w, k], one.table_offsets[t])
        assert got.rot[w, k] == one.table_rots[t]
        np.testing.assert_array_equal(got.half[w, k], one.table_full_sizes[t, :2] / 2)
        assert got.there[w, k] == (one.table_active[t] & one.object_active[k])
    assert 0 < got.there.mean() < 1


def test_not_finite(tmp_path):
    """A spring that pushes away: x grows by exp(100 t), so that the step is known."""
    arena = mja.TableArena()
    arena.attach(UNSTABLE)
    report = mja.check(arena, TURNED, 2, n_steps=200, engine="c")
    assert set(report.failures) == {"not_finite"}
    # Gravity starts it: x = -g/w^2 (cosh(w t) - 1); the acceleration, w^2 x - g, is the first beyond 1e10.
    seconds = np.arccosh(mujoco.mjMAXVAL / 9.81) / 100
    step = report.failures["not_finite"][0].step
    assert step == pytest.approx(seconds / report.timestep, rel=0.05)
    report.save_bundle(tmp_path / "bundle", 1)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.found["not_finite"].step == step


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.parametrize("engine", ["jax", "warp"])
def test_engines_judge_alike(foil, engine, tmp_path):
    """The same worlds fail for the same causes, by as much; on Warp without room, contacts are dropped."""
    n_steps = 60
    want, report = (mja.check(foil, TURNED, 2, n_steps=n_steps, engine=e) for e in ("c", engine))
    assert list(report.failures) == list(want.failures) == ["through_table", "deep_penetration"]
    # Rounding decides whether touching is a contact: if not, the foil falls for a step, and overshoots by two thirds.
    for r in (report, want):
        got = sorted(r.failures["deep_penetration"])
        assert [f.world for f in got] == [0, 1]
        assert all(1.03e-4 < f.number * THICK / 2 < 1.8e-4 for f in got)
    if engine == "jax":
        return

    report = mja.check(foil, TURNED, 2, n_steps=n_steps, engine=engine, max_contacts=3)
    dropped = report.failures["dropped_contacts"]
    assert {f.world for f in dropped} == {0, 1}
    assert all(f.step <= 2 and f.number >= 8 for f in dropped)  # four contacts each of foil and cube
    report.save_bundle(tmp_path / "bundle", 0)
    replay = mja.replay(tmp_path / "bundle")
    assert (replay.reproduced, replay.room, replay.contacts) == (True, 3, 8)
    enough = mja.check(foil, TURNED, 2, n_steps=n_steps, engine=engine, max_contacts=int(dropped[0].number))
    assert "dropped_contacts" not in enough.failures


def test_first_events():
    """An object that is below the top after it went over the edge is off the table, not through it; absent ones are neither."""
    seen = watch.nothing(1, 3)
    there = np.array([[True, True, False]])
    outside = [[-1, -1, 9], [0.1, -1, 9], [0.3, -1, 9], [-0.2, 0.5, 9]]
    below = [[-1, -1, 9], [-1, 0.2, 9], [0.5, 0.1, 9], [0.7, 0.9, 9]]
    goods = []
    for out, under in zip(outside, below, strict=True):
        one = np.ones(1, bool)
        zero, none = np.zeros(1), np.zeros((1, 2), int)
        now = watch.Now(one, ~one, np.int32(0), zero, zero, none, np.array([out]), np.array([under]))
        seen, good = watch.update(seen, now, there)
        goods.append(bool(good[0]))
    never = watch.NEVER
    assert seen.off.tolist() == [[2, never, never]]
    assert seen.through.tolist() == [[never, 2, never]]
    assert seen.outside.tolist() == [[0.3, 0, 0]]
    assert seen.below.tolist() == [[0, 0.9, 0]]
    assert goods == [True, False, False, False]


def test_places():
    """Distances outside and below on a turned table, worked out by hand."""
    tops = watch.Tops(
        np.array([[[1.0, 2.0, 0.8]]]),
        np.array([[np.pi / 2]]),
        np.array([[[0.3, 0.5]]]),
        np.ones((1, 1), bool),
        np.zeros((1, 3)),
    )
    quat = np.array([[[1.0, 0, 0, 0]]])
    outside, below = watch.out_of_place(tops, np.array([[[1.6, 2.1, 0.7]]]), quat)
    np.testing.assert_allclose([outside[0, 0], below[0, 0]], [0.1, 0.1])  # its y axis is the world's -x
    upside_down, center = np.array([[[0, 1.0, 0, 0]]]), np.array([[0, 0, 0.05]])
    below = watch.out_of_place(tops._replace(center=center), np.array([[[1.0, 2.0, 0.8]]]), upside_down)[1]
    np.testing.assert_allclose(below, 0.05)


def test_half_extents():
    """The smallest of what each shape extends to, whatever its other sizes hold."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody>
        <geom type="plane" size="1 1 0.1"/><geom type="sphere" size="0.1"/><geom type="capsule" size="0.2 0.05"/>
        <geom type="cylinder" size="0.2 0.05"/><geom type="box" size="0.3 0.1 0.2"/><geom type="ellipsoid" size="0.3 0.1 0.2"/>
        </worldbody></mujoco>"""
    )
    np.testing.assert_allclose(
        watch.half_extents(model.geom_type, model.geom_size), [np.inf, 0.1, 0.2, 0.05, 0.1, 0.1], rtol=1e-12
    )


def test_dropped_in_c():
    """C counts what found no room in its memory."""
    box = '<body pos="{} 0 0.049"><freejoint/><geom type="box" size="0.1 0.1 0.05"/></body>'
    boxes = "".join(box.format(i) for i in range(10))
    xml = f'<mujoco><size memory="{{}}"/><worldbody><geom type="plane" size="1 1 1"/>{boxes}</worldbody></mujoco>'
    empty = watch.Tops(
        np.zeros((1, 0, 3)), np.zeros((1, 0)), np.zeros((1, 0, 2)), np.ones((1, 0), bool), np.zeros((0, 3))
    )
    steps = {}
    for memory in ("25000", "1M"):
        model = mujoco.MjModel.from_xml_string(xml.format(memory))
        steps[memory] = int(watch_c.roll(lambda _, model=model: mujoco.MjData(model), empty, [], 3).seen.dropped[0])
    assert steps == {"25000": 1, "1M": watch.NEVER}


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"n_worlds": 2, "worlds": [1]}, "Give `n_worlds` or `worlds`, not both."),
        ({"n_worlds": 0}, "`n_worlds` must be a whole number >= 1, got 0."),
        ({"worlds": []}, "`worlds` must be at least one number, got none."),
        ({"worlds": [-1]}, r"`worlds` must be \(W,\) whole numbers from 0 to 2\^32 - 1, got \[-1\]."),
        ({"n_steps": 0}, "`n_steps` must be a whole number >= 1, got 0."),
        ({"engine": "mjx"}, "`engine` must be 'jax', 'warp', 'c' or None, got 'mjx'."),
        ({"engine": "c", "max_contacts": 3}, "`max_contacts` must be None with engine='c', which drops none, got 3."),
        ({"n_worlds": 1, "engine": "c", "keyframe": "home"}, "`keyframe` must be None, as the arena has no keyframes"),
    ],
)
def test_wrong_use(foil, given, sentence):
    with pytest.raises(ValueError, match=sentence):
        mja.check(foil, TURNED, **given)


def test_bundles_that_are_none(foil, tmp_path, monkeypatch):
    """What is no bundle is neither replaced nor replayed."""
    report = mja.check(foil, TURNED, 1, n_steps=12, engine="c")
    (mine := tmp_path / "mine").mkdir()
    (mine / "thesis.txt").write_text("all of it")
    with pytest.raises(FileExistsError, match="is there already and is no bundle: choose another folder"):
        report.save_bundle(mine, 0)
    assert [f.name for f in tmp_path.rglob("*.*")] == ["thesis.txt"]
    with pytest.raises(FileNotFoundError, match="is no bundle"):
        mja.replay(mine)
    with pytest.raises(FileNotFoundError, match="does not exist"):
        mja.replay(tmp_path / "yours")
    with pytest.raises(ValueError, match="`world` must be one of the worlds that were checked, got 5"):
        report.save_bundle(tmp_path / "five", 5)

    report.save_bundle(tmp_path / "bundle", 0)
    with pytest.raises(FileNotFoundError, match=r"is no bundle of a failed world: .*; 'bundle' in it may be one"):
        mja.replay(tmp_path)
    (tmp_path / "bundle" / "note.txt").write_text("of the first")
    for wrong in (OSError(28, "No space left on device"), KeyboardInterrupt()):

        def refuse(source, target, replace=os.replace, wrong=wrong):
            if str(source).endswith("/bundle") and str(target).endswith("/bundle"):  # the new one, to its place
                raise wrong
            replace(source, target)

        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", refuse)
            with pytest.raises(type(wrong)):
                report.save_bundle(tmp_path / "bundle", 0)
        assert (tmp_path / "bundle" / "note.txt").exists()
    report.save_bundle(tmp_path / "bundle", 0)
    assert sorted(f.name for f in (tmp_path / "bundle").iterdir()) == [
        "failure.json",
        "params.json",
        "states.npz",
        "world.xml",
    ]
    (tmp_path / "bundle" / "states.npz").write_bytes(b"half of it")
    with pytest.raises(ValueError, match=r"states\.npz' is not what `check` wrote: it is no \.npz file\.$"):
        mja.replay(tmp_path / "bundle")
    assert not [f for f in tmp_path.iterdir() if f.name.startswith(".")]


@pytest.mark.slow
def test_command_line(tmp_path, monkeypatch, capsys):
    """check, then the very commands that it prints."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "foil.yaml").write_text(FOIL)
    assert cli.main(["check", "foil.yaml", "--worlds", "4,9", "--steps", "12", "--engine", "c"]) == 1
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert lines[0] == "2 of 2 worlds fail (seed 0, 12 steps or 0.024 s on C MuJoCo)."
    assert lines[3].split()[:6] == ["through", "its", "table", "2", "100.0", "%"]
    commands = [line.partition("mjx-arenas ")[2].split() for line in lines if "mjx-arenas" in line]
    assert [command[0] for command in commands][:2] == ["render", "replay"]
    for command in commands:
        assert cli.main(command) == 0
    assert "from its start: the same failure shows" in capsys.readouterr().out
    assert cli.main([*commands[1], "-o", "picture.png", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["reproduced"]
    assert (tmp_path / "picture.png").exists()

    assert cli.main(["check", "foil.yaml", "-n", "1", "--steps", "12", "--engine", "c", "--json", "-o", "b"]) == 1
    report = json.loads(capsys.readouterr().out)
    assert report["n_failed"] == 1
    assert report["bundles"] == {"0": "b/world_0"}

    assert cli.main(["replay", "foil.yaml"]) == 2
    assert capsys.readouterr().err.startswith(
        "error: 'foil.yaml' is a file: give a folder that `check` or `save_bundle` wrote."
    )
    assert cli.main(["check", "foil.yaml", "-o", "foil.yaml/x"]) == 2
    assert cli.main(["replay", "b/world_0", "-o", "a.jpg"]) == 2
    assert "must end in .png" in capsys.readouterr().err


def test_invalid_by_a_term(tmp_path):
    """A world in which a term's numbers cannot be together is invalid for the same reason when it is read again."""
    xml = '<mujoco><worldbody><body name="arm"><joint name="hinge" range="-1 1"/><geom size=".1"/></body></worldbody></mujoco>'
    arena = mja.Arena.from_xml(xml)
    arena.vary(reach=dr.Term("joint.range", "hinge"))
    ranges = mja.ArenaRanges(terms={"reach": mja.Uniform([[-1, -1]], [[1, 1]])})
    report = mja.check(arena, ranges, 16, n_steps=1, engine="c")
    world = report.worst[0]
    report.save_bundle(tmp_path / "bundle", world)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert replay.found == report.of(world)
    said = "`terms.reach` of joint 'hinge': the first number must be below the second"
    assert said in replay.found["invalid_arena"].what
