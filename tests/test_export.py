"""A world as files: a plain MuJoCo in another process opens them, far from where they were made, and goes on as we do."""

import json
import os
import pathlib
import shutil
import subprocess
import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import test_attach
import test_scenes
import worlds

import mjx_arenas as mja
from mjx_arenas.build import mjcf, order
from mjx_arenas.files import export

STEPS = 20  # of 2 ms: objects fall 8 mm
PLAIN = """
import json, sys, mujoco
for path, steps in zip(sys.argv[2:], json.loads(sys.argv[1])):
    load = mujoco.MjModel.from_binary_path if path.endswith(".mjb") else mujoco.MjModel.from_xml_path
    model = load(path)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("state").id)
    mujoco.mj_step(model, data, steps)
    print(json.dumps({"qpos": data.qpos.tolist(), "qvel": data.qvel.tolist(), "time": data.time}))
assert not any(name.startswith(("mjx_arenas", "jax")) for name in sys.modules)
"""


def stepped(files, steps, folder):
    """The states that a process with nothing but MuJoCo comes to, from the keyframe of each file."""
    run = subprocess.run(
        [sys.executable, "-I", "-c", PLAIN, json.dumps(steps), *map(str, files)],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    return [json.loads(line) for line in run.stdout.splitlines()]


@pytest.mark.xslow_on("jax")
@pytest.mark.slow_on("warp")
@pytest.mark.slow_on("jax")
def test_steps_as_in_the_batch(arena, batch, keys, tmp_path):
    """MJCF and mjb step as the world of the batch does, and through contacts as the model compiled here does."""
    data = mja.make_data(batch, keys)
    data = data.replace(qpos=data.qpos.at[:, arena.layout.object_qpos[:, 2]].add(0.02))
    files, compiled = [], []
    for i, suffix in ((3, "xml"), (8, "mjb"), (11, "xml")):
        world = mja.take(data, i)
        arena.export(batch.world(i), tmp_path / f"{i}", world, suffix, seed=0, world=i)
        shutil.move(tmp_path / f"{i}", tmp_path / f"moved{i}")
        files += [tmp_path / f"moved{i}" / f"world.{suffix}"] * 2
        model, c = arena.c_world(batch.world(i), world)
        mujoco.mj_step(model, c, 10 * STEPS)
        compiled.append(c.qpos)
    states = stepped(files, [STEPS, 10 * STEPS] * 3, tmp_path)

    for _ in range(STEPS):
        data = mja.step(batch, data)
    rounding = STEPS * 4 * 2.0**-24  # one rounding of float32 a step, of numbers below 4 m
    for k, i in enumerate((3, 8, 11)):
        falling, rests = states[2 * k : 2 * k + 2]
        np.testing.assert_allclose(falling["qpos"], data.qpos[i], rtol=0, atol=rounding)
        np.testing.assert_allclose(falling["qvel"], data.qvel[i], rtol=0, atol=rounding)
        assert falling["time"] == pytest.approx(STEPS * 0.002)
        # MJCF has 9 digits, and MuJoCo normalizes a keyframe's quaternions: contacts may make that a little larger.
        close = 1e-6 if files[2 * k].suffix == ".xml" else 1e-12
        np.testing.assert_allclose(rests["qpos"], compiled[k], rtol=0, atol=close)
    z = arena.layout.object_qpos[:, 2]
    assert np.abs(np.array(states[1]["qpos"])[z] - worlds.rest_heights(arena, batch.params)[3]).max() < 1e-3


@pytest.mark.slow
def test_parameters_are_noted(arena, batch, tmp_path):
    """The JSON holds the parameters to the bit, and what else says which world this is."""
    params = batch.world(5)
    arena.export(params, tmp_path / "world", seed=np.int64(3), world=np.int64(5))
    assert sorted(os.listdir(tmp_path / "world")) == ["params.json", "world.xml"]
    note = json.loads((tmp_path / "world" / "params.json").read_text())
    assert (note["seed"], note["world"], note["tables"]) == (3, 5, arena.table_names)
    assert note["objects"] == [o.name for o in arena.objects]
    assert note["versions"]["mujoco"] == mujoco.__version__
    for name, value in note["params"].items():
        np.testing.assert_array_equal(np.asarray(value, np.float32), np.asarray(getattr(params, name), np.float32))
    again = mja.ArenaParams(**note["params"])
    assert arena.to_xml(again) == arena.to_xml(params)


def crowded(tmp_path):
    """An arena with a robot, meshes of objects, files of one name in two folders, and textures."""
    from PIL import Image

    names = ("right", "left", "up", "down", "front", "back")
    for folder in ("one", "two"):
        (tmp_path / folder / "tex").mkdir(parents=True)
        points = (test_scenes.DATA / "wedge.obj").read_text()
        (tmp_path / folder / "part.obj").write_text(points.replace("0.05", "0.04") if folder == "two" else points)
        for k, side in enumerate(names):
            Image.new("RGB", (4, 4), (40 * k, 9, 9)).save(tmp_path / folder / "tex" / f"{side}.png")
        sides = " ".join(f'file{side}="{side}.png"' for side in names)
        (tmp_path / folder / "part.xml").write_text(
            f"""<mujoco><compiler texturedir="tex"/><asset><mesh file="part.obj"/><texture name="cube" type="cube" {sides}/>
            <texture name="flat" type="2d" file="up.png"/><material name="skin" texture="cube"/><material name="lid" texture="flat"/>
            </asset><worldbody><body name="part"><geom type="mesh" mesh="part" material="skin"/>
            <geom type="box" size=".01 .01 .01" pos="0 0 .1" material="lid"/></body></worldbody></mujoco>"""
        )
    held = mujoco.MjSpec.from_string(
        """<mujoco><asset><mesh name="w" file="in/part.obj"/></asset>
        <worldbody><body><geom type="mesh" mesh="w"/></body></worldbody></mujoco>""",
        assets={"in/part.obj": (test_scenes.DATA / "wedge.obj").read_bytes()},
    )
    objects = [
        mja.Object("wedge", "mesh", file=test_scenes.DATA / "wedge.obj", pos=(0.3, 0.3)),
        mja.Object("one", "mjcf", file=tmp_path / "one" / "part.xml", on=1, pos=(0.3, 0.3)),
        mja.Object("two", "mjcf", file=tmp_path / "two" / "part.xml", on=1, pos=(0.3, -0.3)),
    ]
    arena = mja.MultiTableArena([[0, -0.7, 0.8], [0, 0.7, 0.8]], objects=objects)
    arena.attach(test_attach.file("ur5e"), "arm_", pos=(-0.2, 0, 0), on=0)
    arena.attach(held, "held_", pos=(0, 2, 0.5))
    return arena


@pytest.mark.filterwarnings("ignore:.*start:UserWarning")
def test_skins_come_along(tmp_path):
    """Files that are named outside `<asset>`."""
    (tmp_path / "one.skn").write_bytes(b"skin")
    xml = f'<mujoco><deformable><skin name="s" file="{tmp_path}/one.skn"/></deformable></mujoco>'
    params = mja.TableArena().nominal_params()
    export.write(tmp_path / "out", xml, {}, params, {})
    assert 'file="assets/one.skn"' in (tmp_path / "out" / "world.xml").read_text()
    assert (tmp_path / "out" / "assets" / "one.skn").read_bytes() == b"skin"


@pytest.mark.slow
def test_assets_come_along(tmp_path):
    """Robots, meshes and textures of one name are all there; the model is the one that is compiled here, without its sources."""
    arena = crowded(tmp_path)
    params = arena.sample_params(jax.random.key(0), worlds.TABLES._replace(table_full_sizes=None))
    params = params._replace(object_masses=params.object_masses * 1.1)
    model, c = arena.c_world(params)
    c.qpos[:6] += 0.1
    arena.export(params, tmp_path / "out", c)
    arena.export(params, tmp_path / "mjb", c, "mjb")
    for folder in ("one", "two"):
        shutil.rmtree(tmp_path / folder)
    shutil.move(tmp_path / "out", tmp_path / "elsewhere")
    xml = (tmp_path / "elsewhere" / "world.xml").read_text()
    assert str(tmp_path) not in xml
    assert str(test_attach.ROBOTS) not in xml
    for path, rtol in (("elsewhere/world.xml", 1e-12), ("mjb/world.mjb", 0)):
        load = mujoco.MjModel.from_xml_path if rtol else mujoco.MjModel.from_binary_path
        got = load(str(tmp_path / path))
        assert (got.nmesh, got.ntex, got.nu, got.nkey) == (model.nmesh, model.ntex, model.nu, model.nkey + 1)
        np.testing.assert_array_equal(got.key("state").qpos, c.qpos)
        for name in ("mesh_vert", "tex_data", "body_mass", "body_pos", "geom_size", "geom_rgba", "actuator_gainprm"):
            np.testing.assert_allclose(getattr(got, name), getattr(model, name), rtol=rtol, atol=rtol, err_msg=name)
    assert any((got.tex_data == 200).tolist())


def test_absent(tmp_path):
    """What is absent is not in the file, nor in its state."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], objects=[mja.Object("a"), mja.Object("b", on=1)])
    params = arena.nominal_params()._replace(table_active=jnp.array([False, True]))
    data = mujoco.MjData(arena.mj_model)
    data.qpos[7:10] += 0.01
    arena.export(params, tmp_path / "w", data)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "w" / "world.xml"))
    assert [model.body(b).name for b in range(model.nbody)] == ["world", "table1", "b"]
    np.testing.assert_array_equal(model.key("state").qpos, data.qpos[7:])


def test_nothing_half_written(tmp_path, monkeypatch):
    """Where a folder cannot be written one sentence says so, and what was there is as before."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    params = arena.nominal_params()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").touch()
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        OSError,
        match=r"^Cannot write '.*full': the folder is there, with files in it: choose another one, or delete it\.$",
    ):
        arena.export(params, tmp_path / "full")
    with pytest.raises(FileNotFoundError, match=r"^There is no folder '.*nowhere' to write 'world' in\.$"):
        arena.export(params, tmp_path / "nowhere" / "world")
    (tmp_path / "file").touch()
    for path in ("file", "file/world", "file/deeper/world"):
        with pytest.raises(NotADirectoryError) as error:
            arena.export(params, tmp_path / path)
        why = f"{str(tmp_path / 'file')!r} is a file, not a folder"
        assert str(error.value) == f"Cannot write {str(tmp_path / path)!r}: {why}."
    (tmp_path / "file").unlink()
    with pytest.raises(ValueError, match=r"^`seed` must be None or a whole number >= 0, got '3'\.$"):
        arena.export(params, tmp_path / "w", seed="3")
    with pytest.raises(ValueError, match=r"^`format` must be 'xml' or 'mjb', got 'usd'\.$"):
        arena.export(params, tmp_path / "w", format="usd")
    monkeypatch.setattr(json, "dumps", lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        arena.export(params, tmp_path / "w")
    monkeypatch.undo()
    arena.export(params, tmp_path / "empty")
    assert sorted(os.listdir(tmp_path)) == ["empty", "full"]
    assert os.listdir(tmp_path / "full") == ["mine.txt"]
    assert sorted(os.listdir(tmp_path / "empty")) == ["params.json", "world.xml"]


def test_names_beyond_ascii(tmp_path, monkeypatch):
    """Files are in UTF-8, which MuJoCo reads, whatever the locale's encoding is."""

    def write_text(self, text, encoding="ascii"):  # as a locale without more does
        self.write_bytes(text.encode(encoding))

    monkeypatch.setattr(pathlib.Path, "write_text", write_text)
    arena = mja.TableArena(objects=[mja.Object("Würfel")])
    arena.export(arena.nominal_params(), tmp_path / "w")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "w" / "world.xml")).body("Würfel").id > 0


MUSCLE = """<mujoco><compiler><lengthrange mode="none"/></compiler>
  <worldbody><body pos="0 0 1"><joint name="hinge" range="-1 1"/><geom size="0.1"/></body></worldbody>
  <actuator><muscle joint="hinge"/></actuator></mujoco>"""


def test_lost_in_mjcf(tmp_path):
    """What MuJoCo's writer of MJCF leaves out, such as this mode, is no other world in silence: it is refused, or exported compiled."""
    arena = mja.TableArena(xml=MUSCLE)
    assert not arena.mj_model.actuator_lengthrange.any()
    params = arena.nominal_params()
    says = "would compile to another actuator_lengthrange: `arena.export.*mjb"
    with pytest.raises(ValueError, match=f"`params`: .*{says}"):
        arena.to_xml(params)
    with pytest.raises(ValueError, match=f"`params`: .*{says}"):
        arena.export(params, tmp_path / "xml")
    with pytest.raises(ValueError, match=f"`arena.spec`: .*{says}"):
        arena.xml  # noqa: B018
    assert not (tmp_path / "xml").exists()
    arena.export(params, tmp_path / "mjb", format="mjb")
    exported = mujoco.MjModel.from_binary_path(str(tmp_path / "mjb" / "world.mjb"))
    assert not exported.actuator_lengthrange.any()


RICH = """<mujoco><worldbody><body name="a"><freejoint name="f"/><geom name="g" size="0.1"/></body><body name="m" mocap="true"/>
  </worldbody><equality><weld name="w" body1="a" body2="m"/></equality><keyframe><key name="k" qpos="0 0 1 1 0 0 0"/></keyframe>
  <custom><text name="t" data="one"/></custom></mujoco>"""


def lose(spec, what):
    if what == "geom_friction":
        spec.geom("g").friction[0] *= 0.997
    elif what == "opt.iterations":
        spec.option.iterations += 1
    elif what == "key_qpos":
        spec.key("k").qpos = np.array(spec.key("k").qpos) * [1, 1, 0.997, 1, 1, 1, 1]
    elif what == "key_mpos":
        spec.key("k").mpos = np.array([0, 0, 0.003])
    elif what == "eq_active0":
        spec.equality("w").active = False
    elif what == "vis.global.offwidth":
        spec.visual.global_.offwidth += 1
    elif what == "text_data":
        spec.text("t").data = "two"
    elif what == "nuserdata":
        spec.nuserdata = 3


LOST = (
    "geom_friction",
    "opt.iterations",
    "key_qpos",
    "key_mpos",
    "eq_active0",
    "vis.global.offwidth",
    "text_data",
    "nuserdata",
)


@pytest.mark.parametrize("at", ["in frames", "written"])
@pytest.mark.parametrize("what", LOST)
def test_any_loss_is_noticed(monkeypatch, what, at):
    """Of a number by 0.3 %, of an option, of what no step reads: whether it is lost by the writer or before."""
    module, name = (mjcf, "in_full") if at == "written" else (order, "put_frames_in_order")
    as_it_is = getattr(module, name)

    def losing(spec):
        lose(spec, what)
        if at == "written":
            spec.compile()
        return as_it_is(spec)

    monkeypatch.setattr(module, name, losing)
    arena = mja.Arena.from_xml(RICH)
    with pytest.raises(ValueError, match=f"another .*{what}"):
        arena.to_xml(arena.nominal_params())


BODY = '<body name="a" pos="0 0 1">{}</body>'
KEPT = {
    "a size of three numbers": BODY.format('<geom size=".1 .1 .1"/>'),
    "an unnamed site of three": BODY.format('<geom size=".1"/><site size=".1 .2 .3"/>'),
    "an aligned body": BODY.format(
        '<freejoint align="true"/><geom type="box" size=".1 .2 .3" pos=".1 0 0" euler="10 20 30"/><geom size=".1"/>'
    ),
    "a text of XML": "</worldbody><custom><text name='t' data=\"don't &lt; &amp;\"/></custom><worldbody>",
}


@pytest.mark.parametrize("what", KEPT)
def test_what_is_kept(what):
    """Numbers that nothing uses, and rounding, are no other world; texts and names come back."""
    arena = mja.Arena.from_xml(f"<mujoco><worldbody>{KEPT[what]}</worldbody></mujoco>")
    written = mujoco.MjModel.from_xml_string(arena.to_xml(arena.nominal_params()))
    made = arena.compile(arena.nominal_params())
    assert (written.names, written.text_data) == (made.names, made.text_data)
    for name in ("body_mass", "body_inertia", "body_pos", "geom_rbound"):
        np.testing.assert_allclose(getattr(written, name), getattr(made, name), rtol=1e-9, atol=1e-12)


def test_mjcf_that_is_no_xml():
    """MuJoCo writes such a text as it is."""
    arena = mja.TableArena()
    arena.spec.add_text(name="t", data="a]]>b")
    with pytest.raises(ValueError, match=r"the MJCF that MuJoCo writes of this world cannot be read again: .*line"):
        arena.to_xml(arena.nominal_params())


def test_bundles_of_what_mjcf_loses(tmp_path):
    """A world that MJCF would lose is in its bundle as a compiled model, and is replayed from it."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]], xml=MUSCLE, objects=[mja.Object("cube")])
    ranges = mja.ArenaRanges(workspace=mja.Workspace((0, 0), (0.9, 0.9)))  # without the second table
    report = mja.check(arena, ranges, 1, n_steps=2, engine="c")
    report.save_bundle(tmp_path / "bundle", 0)
    assert {"world.mjb"} == {one.name for one in (tmp_path / "bundle").iterdir() if one.name.startswith("world")}
    assert set(report.failures) == {"invalid_arena"}
    assert mja.replay(tmp_path / "bundle").found == report.of(0)


TETRAHEDRON = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def test_assets_in_memory_under_a_folder(tmp_path):
    """MuJoCo looks for them in the compiler's `meshdir`, as for files."""
    text = """<mujoco><compiler meshdir="meshes"/><asset><mesh name="m" file="m.obj"/></asset>
      <worldbody><body pos="0 0 1"><freejoint/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""
    spec = mujoco.MjSpec.from_string(text, assets={"meshes/m.obj": TETRAHEDRON})
    arena = mja.Arena.from_xml(spec)
    arena.export(arena.nominal_params(), tmp_path / "world")
    written = mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml"))
    np.testing.assert_array_equal(written.mesh_vert, arena.mj_model.mesh_vert)


@pytest.mark.skipif(not hasattr(mujoco.MjSpec().compiler, "savecompiled"), reason="since MuJoCo 3.16")
def test_how_the_mjcf_would_be_saved():
    """What the compiler is told of saving does not reach the MJCF of worlds, which has what was compiled."""
    rules = '<compiler savecompiled="false" savecanonical="false"/>'
    servo = '<actuator><position joint="j" kp="9" dampratio="1"/></actuator>'
    body = '<worldbody><body><joint name="j"/><geom size=".1" pos=".1 0 0"/></body></worldbody>'
    arena = mja.Arena.from_xml(f"<mujoco>{rules}{body}{servo}</mujoco>")
    for text in (arena.xml, arena.to_xml(arena.nominal_params())):
        assert mjcf.lost(arena.mj_model, mujoco.MjModel.from_xml_string(text)) == []
