"""Quantities of `arena.vary` are treated like those of tables: by curricula, tables of worlds, plots, checks, bundles and their replay."""

import csv
import json

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import cli, envs
from mjx_arenas.viz import plots, samples

FILE = """
arena:
  type: Arena.from_xml
  xml: |
    <mujoco><asset><texture name="oak" type="2d" builtin="flat" width="4" height="4"/>
      <texture name="ash" type="2d" builtin="flat" width="4" height="4"/><material name="wood" texture="oak"/></asset>
    <worldbody><light name="lamp" pos="0 0 3"/><light name="sun" pos="1 0 3"/><geom name="floor" type="plane" size="3 3 .1"/>
    <body name="post" pos="1 0 .1"><geom name="post" type="box" size=".1 .1 .1"/></body>
    <body name="ball" pos="0 0 .3"><freejoint/><geom name="ball" size=".1"/></body>
    <body name="arm" pos="-1 0 1"><joint name="hinge" axis="0 1 0"/><geom name="arm" type="capsule" size=".02 .1" mass="1"/></body>
    </worldbody></mujoco>
  then:
    - vary:
        mass: {attribute: body.mass, elements: [ball, arm]}
        grip: {attribute: geom.friction, elements: [floor, ball], axes: sliding}
        start: {attribute: body.pos, elements: ball}
        angle: {attribute: joint.qpos, elements: hinge}
        lights: {attribute: light.active}
        there: {attribute: body.active, elements: post}
        wood: {attribute: material.texture, elements: wood}
        gravity: {attribute: option.gravity, axes: z}
ranges:
  terms:
    mass: {LogUniform: {low: 0.5, high: 2.0, relative: scale}}
    grip: {Uniform: [0.4, 1.4]}
    start: {Uniform: {low: [-0.2, -0.2, -0.25], high: [0.2, 0.2, 0.1], relative: add}}
    angle: {Normal: {mean: 0.0, std: 0.2, low: -0.5, high: 0.5}}
    lights: {Bernoulli: 0.5}
    there: {Bernoulli: 0.5}
    wood: {Choice: [0, 1]}
    gravity: {Uniform: {low: -0.5, high: 0.5, relative: add}}
"""
COLUMNS = {
    "mass": ["mass.ball", "mass.arm"],
    "grip": ["grip.floor.sliding", "grip.ball.sliding"],
    "start": [f"start.ball.{axis}" for axis in "xyz"],
    "angle": ["angle.hinge"],
    "lights": ["lights.lamp", "lights.sun"],
    "there": ["there.post"],
    "wood": ["wood.wood"],
    "gravity": ["gravity.option.z"],
}
"""The numbers that vary, by their quantities."""
N = 64


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The arena of the file, its ranges, and what N worlds draw."""
    file = tmp_path_factory.mktemp("alike") / "alike.yaml"
    file.write_text(FILE)
    arena, ranges = mja.load(file)
    return arena, ranges, samples.draw(arena.record, ranges, 0, range(N))


@pytest.mark.slow
def test_curriculum(made):
    """Nominal at level 0, the draws of the full ranges at level 1, and in between within both; a choice is the same at every level."""
    arena, ranges, full = made
    at, nominal = envs.widening(arena, ranges), arena.nominal_params().terms

    def one(level, key):
        params = arena.sample_params(key, at(level))
        return params.terms, arena.valid(params, at(level))

    draw = jax.jit(jax.vmap(one, in_axes=(None, 0)))
    none, half, whole = (draw(np.float32(level), mja.world_keys(0, range(N))) for level in (0, 0.5, 1))
    for terms, valid in (none, half, whole):
        assert valid.all()
        assert terms.keys() == COLUMNS.keys()
    for name, end in full.params.terms.items():
        np.testing.assert_allclose(whole[0][name], end, rtol=1e-6, atol=1e-7, err_msg=name)
        if name == "wood":
            np.testing.assert_array_equal(none[0][name], end)
            continue
        start = np.asarray(nominal[name], float)
        np.testing.assert_allclose(none[0][name], np.broadcast_to(start, end.shape), rtol=1e-6, atol=1e-7, err_msg=name)
        spread = [np.asarray(terms[name], float).std(0).max() for terms, _ in (none, half, whole)]
        assert spread[0] < 1e-6 < spread[1]
        if end.dtype != bool:
            assert spread[1] < spread[2]
    at(0.5)  # and of numbers: as the library wants ranges
    arena.sample_params(mja.world_keys(0, [0])[0], at(0.5))


def test_columns(made):
    """One for each number that varies, under the names of quantity, element and axis, with the worlds' numbers."""
    arena, _, drawn = made
    columns = {column.name: column for column in samples.columns(arena.record, drawn.params)}
    assert {name for name, column in columns.items() if column.varies} == {
        n for names in COLUMNS.values() for n in names
    }
    said = {".".join(filter(None, (r.quantity, r.item, r.axis))) for r in arena.describe(drawn.params).varying}
    assert said == {n for names in COLUMNS.values() for n in names}
    terms = drawn.params.terms
    for name, want in (
        ("mass.arm", terms["mass"][:, 1]),
        ("start.ball.z", terms["start"][:, 0, 2]),
        ("lights.sun", terms["lights"][:, 1]),
    ):
        np.testing.assert_array_equal(columns[name].values, want)


@pytest.mark.slow
def test_files_of_worlds(made, here, capsys):
    """`mjx-arenas sample`: arrays in .npz and columns in .csv; `stats`: the table and the plots."""
    drawn = made[2]
    (here / "alike.yaml").write_text(FILE)
    cli.main(["sample", "alike.yaml", "-n", str(N), "-o", "worlds.npz"])
    with np.load("worlds.npz") as arrays:
        for name, values in drawn.params.terms.items():
            np.testing.assert_array_equal(arrays[name], values, err_msg=name)
    cli.main(["sample", "alike.yaml", "-n", str(N), "-o", "worlds.csv"])
    with open("worlds.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == N
    for columns in COLUMNS.values():
        assert all(column in rows[0] for column in columns)
    np.testing.assert_allclose([float(row["mass.arm"]) for row in rows], drawn.params.terms["mass"][:, 1], rtol=1e-6)
    capsys.readouterr()
    cli.main(["stats", "alike.yaml", "-n", str(N), "--json", "-o", "plots"])
    said = json.loads(capsys.readouterr().out)
    found = {".".join(filter(None, (r["quantity"], r["item"], r["axis"]))): r for r in said["varies"]}
    assert found.keys() == {n for names in COLUMNS.values() for n in names}
    assert [found["mass.ball"][k] for k in ("min", "max")] == pytest.approx(
        [f(drawn.params.terms["mass"][:, 0]) for f in (np.min, np.max)], rel=1e-6
    )
    assert sorted(file.name for file in (here / "plots").iterdir()) == ["histograms.png", "pairs.png"]  # of no table


def test_plots(made):
    """Histograms have an axis for each quantity and axis, with what the elements are called; pairs are of what varies."""
    arena, _, drawn = made
    columns = [column for column in samples.columns(arena.record, drawn.params) if column.varies]
    axes = [axis for axis in plots.histograms(columns, "64 worlds").axes if axis.get_visible()]
    panels = [
        f"{name} {column.split('.')[2]}" if column.count(".") > 1 else name
        for name, of in COLUMNS.items()
        for column in of
    ]
    panels = list(dict.fromkeys(panels))
    assert len(axes) == len(panels)
    for axis, panel in zip(axes, panels, strict=True):
        assert axis.get_xlabel().startswith(panel)
    assert {text.get_text() for text in axes[0].get_legend().get_texts()} == {"ball", "arm"}
    assert {label.get_text() for label in axes[panels.index("lights")].get_xticklabels()} == {"lamp", "sun"}
    paired = {
        label
        for axis in plots.pairs(columns, np.ones(N, bool), "64 worlds").axes
        for label in (axis.get_xlabel(), axis.get_ylabel())
    }
    assert any(label.startswith("mass") for label in paired)


@pytest.mark.slow
def test_checks_and_bundles(made, tmp_path):
    """A world in which a ball starts in the floor fails; its bundle has what varies, the world with it, and replays to the same failure."""
    arena, ranges, drawn = made
    report = mja.check(arena, ranges, 16, engine="c", n_steps=20)
    start = drawn.params.terms["start"][:16, 0, 2]
    deep = set(np.flatnonzero(start < 0.1 - 0.03).tolist())
    assert deep
    assert deep <= set(report.worst)
    world = min(deep)
    report.save_bundle(tmp_path / "bundle", world)
    replay = mja.replay(tmp_path / "bundle")
    assert replay.reproduced
    assert set(replay.found) == set(report.of(world))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "bundle" / "world.xml"))
    terms = {name: values[world] for name, values in drawn.params.terms.items()}
    assert model.body("ball").mass == pytest.approx(terms["mass"][0], rel=1e-6)
    assert model.geom("floor").friction[0] == pytest.approx(terms["grip"][0, 0], rel=1e-6)
    assert model.opt.gravity[2] == pytest.approx(terms["gravity"][0, 2], rel=1e-6)
    assert ("post" in [model.body(b).name for b in range(model.nbody)]) == bool(terms["there"][0])
    text = json.dumps([json.loads(file.read_text()) for file in (tmp_path / "bundle").glob("*.json")])
    for name in COLUMNS:
        assert f'"{name}"' in text
