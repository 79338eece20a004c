"""Furniture in words, plans, pictures, plots, checks and on the command line: every part is there, under its name and where it stands."""

import csv
import json
import pathlib
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from matplotlib.patches import Polygon
from test_furniture import furnished
from test_plan import names_apart

import mjx_arenas as mja
from mjx_arenas import cli, furniture, geometry
from mjx_arenas.build import mjcf
from mjx_arenas.furniture import standing
from mjx_arenas.params.params import on_host
from mjx_arenas.pixels import labels
from mjx_arenas.record.elsewhere import elsewhere
from mjx_arenas.viz import describe, plan, plots, render, samples

U = mja.Uniform
RANGES = mja.ArenaRanges(
    terms={
        "rack.pos": U([1.0, -0.2, 0], [1.6, 0.2, 0]),
        "rack.heights": U(-0.2, 0.2, relative="add"),
        "rack.pieces_active": mja.Bernoulli(0.5),
        "crate.active": mja.Bernoulli(0.5),
        "crate.rot": U(-0.4, 0.4),
        "drawers.openings": U(0.0, 0.3),
    }
)


def kitchen():
    return furnished(
        furniture.Shelf("rack", pos=(1.2, 0, 0), heights=(0.3, 0.8)),
        furniture.Bin("crate", pos=(0.2, 0.2, 0.8), inner_size=(0.15, 0.2, 0.1)),
        furniture.Drawers("drawers", pos=(2.05, 0, 0), heights=(0.2, 0.2)),
        furniture.Ramp("ramp", pos=(-1.6, 0, 0), rot=0.3),
    )


@pytest.fixture(scope="module")
def arena():
    return kitchen()


@pytest.fixture(scope="module")
def many(arena):
    """(12, ...)"""
    return jax.jit(jax.vmap(lambda key: arena.sample_params(key, RANGES)))(mja.world_keys(1, range(12)))


def other(arena, **terms):
    nominal = arena.nominal_params()
    return nominal._replace(terms={**nominal.terms, **{k.replace("__", "."): jnp.asarray(v) for k, v in terms.items()}})


def test_one_world(arena):
    """What is where, what is absent, and the numbers of each part with their units."""
    params = other(
        arena,
        rack__rot=[0.5],
        rack__pieces_active=[True, False],
        crate__active=[False],
        drawers__openings=[0.1, 0.0],
    )
    world = arena.describe(params)
    blocks = str(world).split("\n\n")
    assert blocks[2] == (
        "part             kind     pos [m]               size [m]               yaw [deg]  without\n"
        "rack             Shelf    1.200, 0.000, 0.000   0.350 x 0.900 x 0.800  28.6       board1\n"
        "crate    absent  Bin      0.200, 0.200, 0.800   0.170 x 0.220 x 0.110  0.0\n"
        "drawers          Drawers  2.050, 0.000, 0.000   0.450 x 0.500 x 0.442  0.0\n"
        "ramp             Ramp     -1.600, 0.000, 0.000  1.004 x 1.000 x 0.220  17.2"
    )
    lines = [re.split(r"\s{2,}", line) for line in blocks[3].splitlines()]
    for line in (
        ["rack.heights [m]", "rack board 0", "0.3"],
        ["drawers.openings [m]", "drawers_drawer0", "0.1"],
        ["drawers.damping [N s/m]", "drawers", "5"],
        ["rack.size [m]", "rack", "depth, width", "0.35, 0.9"],
    ):
        assert line in lines
    assert not any(
        line.startswith(("rack.pos", "rack.active", "rack.pieces_active")) for line in blocks[3].splitlines()
    )
    assert [part.present for part in world.parts] == [True, False, True, True]
    assert {s.quantity for s in world.terms} == set(arena.quantities)


def test_size_is_the_box_around(arena):
    """As wide as the compiled geoms reach along the part's axes, whatever its yaw; of a ramp, too."""
    params = other(arena, ramp__rise=[0.35], ramp__rot=[0.8], rack__size=[[0.3, 0.7]], rack__rot=[-0.6])
    model, data = arena.c_world(params)
    for part in arena.describe(params).parts:
        body = model.body(part.name).id
        turn = data.xmat[body].reshape(3, 3)
        points = []
        for g in range(model.ngeom):
            if model.body_rootid[model.geom_bodyid[g]] == body:
                corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * model.geom_size[g]
                points.append((corners @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g]) @ turn)
        np.testing.assert_allclose(np.ptp(np.concatenate(points), axis=0), part.size, atol=1e-6, err_msg=part.name)


def test_host_and_device_have_one_ramp(arena):
    """The slab around a tilted box is the same in NumPy and in JAX."""
    params = other(arena, ramp__rise=[0.35])
    parts = [term.part for term in arena.record.parts.furniture]
    on_device = jax.jit(lambda p: standing.standing(parts, p))(params)
    host = standing.standing(parts, on_host(params))
    for got, want in zip(host, on_device, strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("left", [True, False])
def test_drawers_and_doors_stand_where_they_start(left):
    """Their slabs are the compiled world's geoms in its first state, in NumPy and in JAX."""
    arena = furnished(
        furniture.Drawers("drawers", pos=(2, 0, 0), rot=0.4, heights=(0.2, 0.2)),
        furniture.Cupboard("cupboard", pos=(2, 2, 0.5), rot=-0.7, hinge_left=left),
    )
    params = other(arena, drawers__openings=[0.25, 0.1], cupboard__opening=[1.2])
    parts = [term.part for term in arena.record.parts.furniture]
    model, c = arena.c_world(params)
    for slabs in (jax.jit(lambda p: standing.standing(parts, p))(params), standing.standing(parts, on_host(params))):
        got = np.sort(geometry.corners(*map(np.asarray, slabs[:3])), axis=1)
        geoms = [model.geom(name).id for name in standing.names(parts)]
        want = np.sort([plan.outline(model, c, g) for g in geoms], axis=1)
        np.testing.assert_allclose(got, want, atol=1e-5)
        tops = [c.geom_xpos[g, 2] + model.geom_size[g, 2] for g in geoms]
        np.testing.assert_allclose(slabs.top[:, 2], tops, atol=1e-6)


def test_many_worlds(arena, many):
    """Least, mean and most in the worlds in which the part is; of what comes and goes the share of all."""
    said = arena.describe(many)
    found = {(r.quantity, r.item, r.axis): r for r in said.ranges}
    there = np.asarray(many.terms["crate.active"][:, 0])
    assert 0 < there.mean() < 1
    for name, item, axis, values in (
        ("crate.rot", "crate", "", many.terms["crate.rot"][there, 0]),
        ("rack.pos", "rack", "x", many.terms["rack.pos"][:, 0, 0]),
        ("rack.heights", "rack board 1", "", many.terms["rack.heights"][:, 1]),
        ("drawers.openings", "drawers_drawer1", "", many.terms["drawers.openings"][:, 1]),
    ):
        values = np.asarray(values)
        np.testing.assert_allclose(found[name, item, axis][5:8], (values.min(), values.mean(), values.max()), rtol=1e-5)
    assert found["crate.active", "crate", ""].mean == there.mean()
    assert found["crate.active", "crate", ""].kind == "truth"
    board = np.asarray(many.terms["rack.pieces_active"][:, 0]).mean()
    assert found["rack.pieces_active", "rack_board0", ""].mean == board
    assert found["drawers.damping", "drawers", ""].unit == "[N s/m]"
    assert {r.quantity for r in said.varying} == RANGES.terms.keys()
    gone = describe.worlds(
        many._replace(terms={**many.terms, "rack.active": jnp.zeros((12, 1), bool)}),
        arena.record.nominal,
        ["table"],
        ["cube"],
        arena.record.parts.selected,
        arena.record.parts.places.ground,
    )
    shares = [r.mean for r in gone.ranges if r.quantity == "rack.pieces_active"]
    assert shares == [0.0, 0.0]  # with the rack, its boards


def polygons(figure):
    """(n, 2) corners of the boxes of furniture."""
    found = [p for p in figure.axes[0].patches if isinstance(p, Polygon)]
    return [p.get_xy()[:-1] for p in found if p.get_facecolor()[:3] == pytest.approx(plan.WOOD)]


def test_plan(arena):
    """Each box that is there is drawn where the state has it, the lower below the higher; parts are named and listed."""
    params = other(arena, crate__rot=[0.3], rack__pieces_active=[True, False], drawers__openings=[0.2, 0.0])
    model, c = arena.c_world(params)
    figure = arena.plan(params, c)
    want = [
        plan.outline(model, c, g)
        for name in ("rack", "crate", "drawers", "ramp")
        for g in range(model.ngeom)
        if model.body_rootid[model.geom_bodyid[g]] == model.body(name).id
    ]
    drawn = polygons(figure)
    assert len(drawn) == len(want) == 4 + 5 + 15 + 1
    ends = lambda corners: sorted((*p.min(0).round(5), *p.max(0).round(5)) for p in corners)  # noqa: E731
    np.testing.assert_allclose(ends(drawn), ends(want), atol=1e-5)
    assert min(p[:, 0].min() for p in drawn if p[:, 0].min() > 1.5) == pytest.approx(2.05 - 0.225 - 0.2, abs=1e-6)
    patches = [p for p in figure.axes[0].patches if isinstance(p, Polygon)]
    table = next(i for i, p in enumerate(patches) if p.get_facecolor()[0] == pytest.approx(0.94))
    crate = [i for i, p in enumerate(patches) if (abs(p.get_xy()) < [0.4, 0.4]).all() and i != table]
    assert min(crate) > table  # it stands on it
    names = names_apart(figure)
    assert {"rack", "crate", "drawers", "ramp", "table", "cube"} < set(names)
    notes = figure.axes[1].texts[0].get_text()
    assert "crate    Bin      0.170 x 0.220 x 0.110  17.2       0.800" in notes
    (left, right), (low, high) = figure.axes[0].get_xlim(), figure.axes[0].get_ylim()
    assert (np.concatenate(drawn) > [left, low]).all()
    assert (np.concatenate(drawn) < [right, high]).all()

    absent = other(arena, crate__active=[False], ramp__active=[False])
    figure = arena.plan(absent)
    assert len(polygons(figure)) == 5 + 15
    assert not {"crate", "ramp"} & {text.get_text() for text in figure.axes[0].texts}
    rows = [line.split() for line in figure.axes[1].texts[0].get_text().splitlines()]
    assert ["crate", "absent"] in rows


def test_overview(arena):
    """Every corner of every box is in the picture, and the camera looks at the fronts."""
    model, c = arena.c_world(arena.nominal_params())
    camera = render.overview(["table"], [(model, c)], 4 / 3, arena.record.part_names)
    turn, tilt = np.radians([camera.azimuth, camera.elevation])
    ahead = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
    right = np.array([np.sin(turn), -np.cos(turn), 0])
    assert ahead[0] > 0.8
    eye = camera.lookat - camera.distance * ahead
    for g in range(model.ngeom):
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX:
            corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * model.geom_size[g]
            away = corners @ data_turn(c, g).T + c.geom_xpos[g] - eye
            across = away @ np.stack([right, np.cross(right, ahead)], axis=1) / (away @ ahead)[:, None]
            half = np.tan(np.radians(model.vis.global_.fovy) / 2)
            assert (abs(across) <= half * np.array([4 / 3, 1])).all(), model.geom(g).name


def data_turn(c, g):
    return c.geom_xmat[g].reshape(3, 3)


def test_labels(arena):
    """Pixels of a part are the part's, boards and drawers too."""
    record = arena.record
    found = labels.of(record.mj_model, record.layout.table_body)
    assert found.names == ("floor", "table", "cube", "rack", "crate", "drawers", "ramp")
    for name in ("rack_board1", "rack_back", "drawers_drawer1_front", "crate_left"):
        part = name.partition("_")[0]
        assert found.names[found.of_geoms[record.mj_model.geom(name).id]] == part


def test_coverage_has_furniture(arena, many):
    """Over the worlds, of whether a table or a box that is there covers a place."""
    parts = [term.part for term in arena.record.parts.furniture]
    params = jax.tree.map(np.asarray, many)
    figure = plots.coverage(params, on_host(arena.nominal_params()), ["table"], "12 worlds", parts)
    mesh = figure.axes[0].collections[0]
    share, corners = mesh.get_array(), mesh.get_coordinates()
    middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2
    away = abs(middles - [1.3, 0]).max(-1)
    rack = params.terms["rack.pos"][:, 0, :2]
    boards = params.terms["rack.pieces_active"].any(1)
    inside = [abs(middles - at).max(-1) < 0.15 for at in rack]  # well within depth and width, where only boards are
    nearest = np.unravel_index(away.argmin(), away.shape)
    want = np.mean([here[nearest] and there for here, there in zip(inside, boards, strict=True)])
    assert share[nearest] == pytest.approx(want, abs=0.35)  # of some worlds the back or a side is there
    in_crate = np.unravel_index(abs(middles - [0.2, 0.2]).max(-1).argmin(), away.shape)
    assert share[in_crate] == 1  # on the table
    beside = np.unravel_index(abs(middles - [-1.1, 0.15]).max(-1).argmin(), away.shape)
    assert share[beside] == 1  # the ramp, in every world
    assert figure.axes[0].get_title().startswith("Where tables and furniture stand in 12 worlds")
    assert {text.get_text() for text in figure.axes[0].texts} == {"table", "rack", "crate", "drawers", "ramp"}


def test_columns(arena, many):
    """A table of worlds has one column for each number of a part, whose name says it once."""
    names = [column.name for column in samples.columns(arena.record, many)]
    assert len(set(names)) == len(names)
    assert {"rack.pos.x", "rack.heights.board 1", "rack.pieces_active.board1", "drawers.openings.drawer0"} < set(names)
    assert {"crate.active", "ramp.rise", "rack.size.depth", "table_offsets.table.x"} < set(names)


CROWDED = mja.ArenaRanges(terms={"rack.pos": U([1.5, 0, 0], [1.9, 0, 0]), "rack.heights": U(-0.2, 0.2, relative="add")})


@pytest.mark.xslow
@pytest.mark.slow
def test_check(arena, tmp_path):
    """Overlaps are found by world with both names, drawn, kept, and said again by their bundles."""
    report = mja.check(arena, CROWDED, worlds=range(6), n_steps=2, engine="c")
    found = {f.world: f for f in report.failures["invalid_arena"]}
    assert 1 < len(found) < 6
    terms = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(6)), CROWDED)
    assert set(found) == set(np.flatnonzero(~terms.valid).tolist())
    for world, failure in found.items():
        assert failure.what.startswith("Part 'rack' and part 'drawers' overlap, 'rack_back' and 'drawers_right' by ")
        assert arena.problems(terms.world(world), CROWDED) == [failure.what]
    assert "Part 'rack' and part 'drawers' overlap" in str(report)
    world = next(iter(found))
    folder = tmp_path / "bundle"
    report.save_bundle(folder, world)
    assert mja.replay(folder).found["invalid_arena"] == found[world]
    file = folder / "failure.json"
    about = json.loads(file.read_text())
    assert about["rules"]["furniture"][0] == {"Shelf": {"name": "rack", "pos": [1.2, 0.0, 0.0], "heights": [0.3, 0.8]}}
    rules = about["rules"]
    for change, says in (
        (
            {"furniture": [{"Nightstand": {"name": "bench"}}]},
            "'Nightstand' is no part of furniture that is known here: import what defines it first.",
        ),
        ({"touching": [[0, 99]]}, ""),
        ({"furniture": rules["furniture"][:1], "touching": []}, ""),
    ):
        file.write_text(json.dumps({**about, "rules": {**rules, **change}}))
        if len(change) == 2:  # of fewer parts nothing is known, and nothing said
            assert "invalid_arena" not in mja.replay(folder).found
            continue
        with pytest.raises(ValueError, match="is not what `check` wrote") as raised:
            mja.replay(folder)
        assert says in str(raised.value)


@pytest.mark.slow
def test_what_a_drawer_does_wrong(tmp_path):
    """A drawer that starts in another part is deep in it: found, and found again in C, with a picture of both."""
    arena = furnished(
        furniture.Drawers("drawers", pos=(2.0, 0, 0), heights=(0.25,)),
        furniture.Wall("pillar", pos=(1.5, 0, 0), full_size=(0.1, 0.3, 1.0)),
    )
    ranges = mja.ArenaRanges(terms={"drawers.openings": mja.Fixed([0.33])})
    report = mja.check(arena, ranges, 1, n_steps=2, engine="c")
    assert set(report.failures) == {"deep_penetration", "invalid_arena"}
    says = "Part 'drawers' and part 'pillar' overlap, 'drawers_drawer0_front' and 'pillar_wall' by "
    assert report.of(0)["invalid_arena"].what.startswith(says)
    assert "pillar_wall" in report.of(0)["deep_penetration"].what
    assert "drawers_drawer0" in report.of(0)["deep_penetration"].what
    report.save_bundle(tmp_path / "bundle", 0)
    again = mja.replay(tmp_path / "bundle")
    assert again.reproduced
    picture = np.asarray(again.picture(160, 120))
    assert picture.std() > 10


@pytest.fixture
def file(tmp_path, monkeypatch):
    """A file of the arena, in a folder to work in."""
    monkeypatch.chdir(tmp_path)
    mja.save(tmp_path / "kitchen.yaml", kitchen(), CROWDED)
    return pathlib.Path("kitchen.yaml")


@pytest.mark.slow
def test_command_line(file, capsys, scenes):
    """Commands that tell of a file with furniture."""
    name = str(file)
    assert cli.main(["stats", name, "-n", "30"]) == 0
    out = capsys.readouterr().out
    assert "rack.heights [m]" in out
    assert "not, such as\n" in out
    assert ": Part 'rack' and part 'drawers' overlap, " in out
    assert cli.main(["sample", name, "-n", "3", "-o", "worlds.csv"]) == 0
    with open("worlds.csv") as rows:
        assert len([row["rack.heights.board 0"] for row in csv.DictReader(rows)]) == 3


@pytest.mark.slow
def test_command_line_draws_and_checks(file, capsys, scenes):
    """The others."""
    name = str(file)
    assert cli.main(["render", name, "-n", "1", "--size", "64x48", "-o", "one.png"]) == 0
    assert cli.main(["render", name, "-n", "1", "--plan", "-o", "plan.png"]) == 0
    assert cli.main(["export", name, "-o", "world"]) == 0
    model = mujoco.MjModel.from_xml_path("world/world.xml")
    assert model.geom("rack_board1").id > 0
    assert model.key("state").qpos.shape == (model.nq,)
    capsys.readouterr()
    assert cli.main(["check", name, "-n", "6", "--steps", "2", "--engine", "c", "-o", "found"]) == 1
    out = capsys.readouterr().out
    assert "Part 'rack' and part 'drawers' overlap" in out
    bundles = sorted(pathlib.Path("found").iterdir())
    assert bundles
    assert cli.main(["replay", str(bundles[0]), "-o", "again.png"]) == 0
    assert "the same failure shows" in capsys.readouterr().out
    assert pathlib.Path("again.png").stat().st_size > 0


@pytest.mark.xslow
@pytest.mark.slow
def test_every_kind_is_known(tmp_path, monkeypatch, capsys):
    """A file, the plan, words, tables of worlds and the command line have each kind of part, under its name."""
    monkeypatch.chdir(tmp_path)
    kinds = {one for one in vars(furniture).values() if isinstance(one, type) and issubclass(one, furniture.part.Part)}
    kinds -= {furniture.part.Part}
    assert len(kinds) == 10
    parts = [kind(kind.__name__.lower()) for kind in sorted(kinds, key=lambda one: one.__name__)]
    arena, terms = mja.TableArena((0.6, 0.6, 0.05)), {}
    for part in furniture.layouts.grid(parts, 4, (3, 3), pos=(2, -4, 0)):
        arena.add_part(part)
        own = next(iter(part.own))
        terms |= {f"{part.name}.{own}": U(0.96, 1.0, relative="scale"), f"{part.name}.rot": U(-0.2, 0.2)}
    ranges = mja.ArenaRanges(terms=terms)
    names = {part.name for part in parts}

    mja.save("all.yaml", arena, ranges)
    again, same = mja.load("all.yaml")
    assert again.layout.places.furniture == arena.layout.places.furniture
    assert same == ranges
    assert {part.name for part in again.describe(again.nominal_params()).parts} == names
    assert {text.get_text() for text in again.plan(again.nominal_params()).axes[0].texts} >= names

    assert cli.main(["stats", "all.yaml", "-n", "4"]) == 0
    out = capsys.readouterr().out
    assert cli.main(["sample", "all.yaml", "-n", "2", "-o", "worlds.csv"]) == 0
    with open("worlds.csv") as rows:
        columns = next(csv.reader(rows))
    for name in terms:
        assert name in out
        assert any(column.startswith(name) for column in columns), name


def test_wrong_file(file, capsys):
    """A part that is wrong is answered with the file, its line and a sentence."""
    text = file.read_text()
    file.write_text(text.replace("heights: [0.3, 0.8]", "heights: [0.8, 0.3]"))
    line = next(i for i, line in enumerate(text.splitlines(), 1) if "heights: [0.3" in line)
    assert cli.main(["stats", str(file)]) == 2
    assert (
        f"kitchen.yaml:{line}: `arena.then[0].add_part.part.Shelf.heights` of part 'rack' must be from the bottom up"
        in capsys.readouterr().err
    )


@pytest.mark.slow
def test_furniture_on_furniture(tmp_path):
    """Parts on parts and zones are where they stand in the world, absent with what carries them; bundles know objects on them."""
    arena = mja.TableArena()
    arena.add_part(furniture.Shelf("rack", pos=(1.5, 0, 0), rot=0.5, heights=(0.3, 0.8)))
    arena.add_part(furniture.Bin("crate", pos=(0, 0.1, 0), inner_size=(0.15, 0.2, 0.1), on="rack_board0"))
    arena.add_part(furniture.Zone("floor_here", pos=(-1, 0.5, 0), size=(0.8, 0.6)))
    arena.add_object(mja.Object("ball", "sphere", 0.06, on="rack_board1"))
    c = arena.c_world(arena.nominal_params())[1]
    parts = {part.name: part for part in arena.describe(arena.nominal_params()).parts}
    np.testing.assert_allclose(parts["crate"].position, c.body("crate").xpos, atol=1e-6)
    assert parts["crate"].yaw == pytest.approx(np.degrees(0.5), rel=1e-5)
    assert parts["floor_here"].size == pytest.approx((0.8, 0.6, 0))
    names = {text.get_text() for text in arena.plan(arena.nominal_params()).axes[0].texts}
    assert {"rack", "crate", "floor_here", "ball"} <= names
    gone = other(arena, rack__pieces_active=[False, True])
    parts = {part.name: part for part in arena.describe(gone).parts}
    assert [parts["rack"].present, parts["crate"].present] == [True, False]

    ranges = mja.ArenaRanges(terms={"rack.thickness": mja.Fixed(0.6)})  # thicker than the boards are apart
    report = mja.check(arena, ranges, 1, n_steps=2, engine="c")
    report.save_bundle(tmp_path / "bundle", 0)
    again = mja.replay(tmp_path / "bundle")
    assert again.found["invalid_arena"] == report.of(0)["invalid_arena"]
    narrow = mja.ArenaRanges(terms={"rack.size": mja.Fixed([0.35, 0.05])})
    report = mja.check(arena, narrow, 1, n_steps=2, engine="c")
    assert "'rack_board1'" in report.of(0)["invalid_arena"].what
    report.save_bundle(tmp_path / "narrow", 0)
    assert mja.replay(tmp_path / "narrow").found["invalid_arena"] == report.of(0)["invalid_arena"]


def test_mjcf_has_all_digits(monkeypatch):
    """Of furniture, and of what follows a table of a scene; a MuJoCo that writes six is refused."""
    scene = """<mujoco><worldbody><body name="desk" pos="0 0 .7"><geom name="slab" type="box" size=".5 .4 .02"/>
      <geom name="side" type="box" size=".02 .4 .34" pos=".48 0 -.36"/></body></worldbody></mujoco>"""
    arena = mja.Arena.from_xml(scene, ["slab"], follow=[mja.Follow("side", x="+", z="floor")])
    for part in (
        furniture.Drawers("unit", pos=(1.5, 0, 0)),
        furniture.Cupboard("cupboard", pos=(1.5, 2, 1.2)),
        furniture.Ramp("ramp", pos=(-1.5, 0, 0)),
    ):
        arena.add_part(part)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    params = elsewhere(
        nominal,
        arena.record.parts,
        [n for n in arena.quantities if not n.endswith(("active", "hinge_left"))],
        0.123456789,
    )
    compiled, again = arena.compile(params), mujoco.MjModel.from_xml_string(arena.to_xml(params))
    for field in (
        "body_pos",
        "body_quat",
        "geom_pos",
        "geom_quat",
        "geom_size",
        "geom_friction",
        "geom_rgba",
        "jnt_range",
        "dof_damping",
    ):
        got, want = getattr(again, field), getattr(compiled, field)
        assert np.abs(got - want).max() < 1e-14, field  # a rounding or two of numbers up to 10
    monkeypatch.setattr(mjcf, "_library", lambda: None)
    with pytest.raises(RuntimeError, match="cannot write MJCF in full precision"):
        arena.to_xml(params)
