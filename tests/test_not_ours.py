"""Scenes that were not written for this library go through all that an arena does."""

import json

import mujoco
import numpy as np
import oracle
import pytest
import worlds
from models import ARMS, ROBOTS

import mjx_arenas as mja
from mjx_arenas import cli, dr

DRAWER = ROBOTS / "ogbench" / "manipspace" / "descriptions" / "drawer.xml"
FIVE = mja.world_keys(0, range(5))
STEPS = 5


def hand(folder):
    """A Shadow hand in the air, whose geoms have no names."""
    return mja.Arena.from_xml(ARMS["shadow_hand"])


def quadruped(folder):
    """A Go1 above a floor."""
    floor = '<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/></worldbody></mujoco>'
    arena = mja.Arena.from_xml(floor)
    arena.attach(ARMS["go1"], "go1_", pos=(0, 0, 1))
    return arena


def drawer(folder):
    """A drawer in its case."""
    return mja.Arena.from_xml(DRAWER)


@pytest.mark.xslow
@pytest.mark.slow
@pytest.mark.parametrize("make", [hand, quadruped, drawer], ids=lambda make: make.__name__)
def test_everything_that_an_arena_does(make, tmp_path, monkeypatch, capsys):
    """Worlds are drawn, stepped on Warp, compiled, exported, stepped in C, checked, replayed, saved, loaded, described and counted."""
    monkeypatch.chdir(tmp_path)
    arena = make(tmp_path)
    arena.vary(
        mass=dr.Term("body.mass"),
        friction=dr.Term("geom.friction", axes="sliding"),
        damping=dr.Term("joint.damping"),
        start=dr.Term("joint.qpos"),
        speed=dr.Term("joint.qvel"),
        step=dr.Term("option.timestep"),
        gravity=dr.Term("option.gravity", axes="z"),
    )
    terms = {
        "mass": mja.Uniform(0.8, 1.2, relative="scale"),
        "friction": mja.Uniform(0.7, 1.3, relative="scale"),
        "damping": mja.Uniform(0.0, 0.1, relative="add"),
        "start": mja.Uniform(-0.02, 0.0),
        "speed": mja.Uniform(-0.1, 0.1),
        "gravity": mja.Uniform(-0.5, 0.5, relative="add"),
    }
    ranges = mja.ArenaRanges(terms=terms)

    batch = arena.randomize(arena.put_model("warp"), FIVE, ranges)
    assert batch.valid.all()
    compiled = {i: arena.compile(batch.world(i)) for i in range(2)}
    assert max(mja.differences(batch.model, compiled).values(), default=0.0) <= oracle.FACTORED * oracle.EPS
    data = mja.make_data(batch, FIVE)
    assert np.isfinite(mja.rollout(batch, data, STEPS).qpos).all()

    c = arena.c_batch(batch.params)
    for i in range(len(FIVE)):
        model, alone = arena.c_world(batch.world(i))
        np.testing.assert_allclose(data.qpos[i], alone.qpos, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(c.qpos[i], alone.qpos, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(model.body_mass[1:], batch.model.body_mass[i, 1:], rtol=1e-5)

    params = worlds.take(batch.params, 1)
    arena.export(params, tmp_path / "world")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    np.testing.assert_allclose(model.body_mass, compiled[1].body_mass, rtol=1e-5)
    np.testing.assert_allclose(model.key("state").qpos, arena.c_world(params)[1].qpos, rtol=1e-5, atol=1e-6)

    report = mja.check(arena, ranges, 4, engine="c", n_steps=STEPS)
    assert report.ok, report
    too_fast = {"step": mja.Fixed(5e4), "speed": mja.Fixed(1e6), "damping": mja.Fixed(0.0)}
    wild = mja.ArenaRanges(terms=terms | too_fast)
    with pytest.warns(UserWarning, match="time steps are in seconds"):
        report = mja.check(arena, wild, 2, engine="c", n_steps=STEPS)
    assert report.failed.all()
    report.save_bundle(tmp_path / "bundle", report.worst[0])
    assert mja.replay(tmp_path / "bundle").reproduced

    mja.save(tmp_path / "scene.yaml", arena, ranges)
    again, loaded = mja.load(tmp_path / "scene.yaml")
    assert loaded == ranges
    assert again.record == arena.record
    shown = arena.describe(batch.params)
    assert {one.quantity for one in shown.varying} == {*terms}
    cli.main(["stats", "scene.yaml", "-n", "16", "--json"])
    assert {one["quantity"] for one in json.loads(capsys.readouterr().out)["varies"]} == {*terms}
