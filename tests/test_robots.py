"""What robots bring along: files, sizes, options, and geoms inside each other."""

import logging
import os
import pathlib
import shutil

import jax
import mujoco
import numpy as np
import pytest
from PIL import Image

import mjx_arenas as mja
from mjx_arenas.files import export

SIDES = ("right", "left", "up", "down", "front", "back")
CUBE = mja.Object("cube", pos=(0.3, 0.3))


def with_robot(xml, prefix="r_", objects=(CUBE,), **kwargs):
    arena = mja.TableArena(objects=objects)
    arena.attach(xml, prefix, **kwargs)
    return arena


def test_sizes_are_shared(capfd):
    """Sizes of both are large enough for both, and MuJoCo says nothing of them."""
    sizes = '<size memory="1M" nuserdata="3" nuser_geom="2" nkey="2"/>'
    robot = f"""<mujoco>{sizes}<worldbody><body name="b"><joint/><geom name="g" size=".05" pos="0 0 3" user="1 2"/></body></worldbody>
      <keyframe><key name="home"/></keyframe></mujoco>"""
    arena = with_robot(robot)
    arena.attach(robot.replace('nuserdata="3"', 'nuserdata="2"'), "s_", pos=(1, 0, 0))
    merged = mja.TableArena(objects=[CUBE]).merge(arena, "m_", pos=(0, 3, 0))
    assert merged.mj_model.nuserdata == 3
    assert merged.mj_model.geom("m_s_g").user.tolist() == [1, 2]
    assert merged.mj_model.nkey == 4
    merged.to_xml(merged.nominal_params())
    assert capfd.readouterr() == ("", "")


SLOW = """<mujoco><option timestep=".001" gravity="0 0 -3"/><worldbody><body name="b"><joint/><geom size=".05" pos="0 0 3"/></body>
  </worldbody></mujoco>"""


def use(arena):
    """What compiles the arena and its worlds, and asks whether it is still what was compiled."""
    params = arena.nominal_params()
    arena.compile(params)
    arena.to_xml(params)
    arena.tile(jax.tree.map(lambda x: np.stack([x, x]), params))
    arena.put_model("jax")


def test_other_options_are_told_once(capfd):
    """Of a robot that `attach` is given, by a warning of ours alone; MuJoCo's "Attach conflict" is printed by none of what follows."""
    arena = mja.TableArena(objects=[CUBE])
    arena.spec.option.timestep = 0.005
    with pytest.warns(UserWarning, match=r"^`robot` ") as told:
        arena.attach(SLOW, "r_")
    assert sorted(str(one.message).partition(":")[0] for one in told) == [
        "`robot` changes options of the whole arena",
        "`robot` has other options than the arena. The arena's are used",
    ]
    use(arena)
    assert capfd.readouterr() == ("", "")


def test_attach_conflict_of_mujoco(capfd):
    """Where a user attaches with MuJoCo, which prints it there: it is said again once, and not at each use of the arena."""
    arena = mja.TableArena(objects=[CUBE])
    arena.spec.attach(mujoco.MjSpec.from_string(SLOW), prefix="r_", frame=arena.spec.worldbody.add_frame())
    printed = "".join(capfd.readouterr())
    assert printed.count("Attach conflict") == 1
    assert "timestep: parent has 0.002 (default), child has 0.001" in printed
    with pytest.warns(UserWarning, match="^Attach conflict") as told:
        use(arena)
    assert len(told) == 1
    assert capfd.readouterr() == ("", "")


def write_part(folder, name, size, red):
    """MJCF of a body with a mesh, a texture and a cube of textures in folders of its own, all under the same names."""
    (folder / name).mkdir(parents=True)
    corners, faces = np.vstack([np.zeros(3), size * np.eye(3)]), ((1, 3, 2), (1, 2, 4), (1, 4, 3), (2, 3, 4))
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {a} {b} {c}" for a, b, c in faces]
    (folder / name / "part.obj").write_text("\n".join(lines) + "\n")
    for side in SIDES:
        Image.new("RGB", (2, 2), (red, len(side), 0)).save(folder / name / f"{side}.png")
    cube = " ".join(f'file{side}="{side}.png"' for side in SIDES)
    file = folder / f"{name}.xml"
    file.write_text(f"""<mujoco model="{name}"><compiler meshdir="{name}" texturedir="{name}"/><asset><mesh name="part" file="part.obj"/>
      <texture name="flat" type="2d" file="up.png"/><texture name="cube" type="cube" {cube}/><material name="m" texture="cube"/></asset>
      <worldbody><body name="{name}"><joint/><geom type="mesh" mesh="part" material="m"/><site name="tip" pos="0 0 .5"/></body>
      </worldbody></mujoco>""")
    return file


def from_two_folders(folder):
    """A spec whose parts were read by relative paths, and which `MjSpec.attach` joined."""
    robot, hand = (
        mujoco.MjSpec.from_file(os.path.relpath(write_part(folder / where, name, size, red)))
        for where, name, size, red in (("one", "assets", 0.1, 50), ("two", "assets", 0.05, 90))
    )
    robot.attach(hand, site=robot.site("tip"), prefix="hand_")
    return robot


def has_both_parts(model, prefix=""):
    """Whether a model has the meshes and the textures of both folders."""
    for name, size, red in (("", 0.1, 50), ("hand_", 0.05, 90)):
        mesh = model.mesh(f"{prefix}{name}part")
        points = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        np.testing.assert_allclose(np.ptp(points, axis=0).max(), np.sqrt(2) * size, rtol=0.3)
        for kind in ("flat", "cube"):
            texture = model.texture(f"{prefix}{name}{kind}")
            pixels = model.tex_data[texture.adr[0] :][: int(texture.height[0] * texture.width[0] * texture.nchannel[0])]
            pixels = pixels.reshape(-1, int(texture.nchannel[0]))
            assert (pixels[:, 0] == red).all()
            assert set(pixels[:, 1]) == ({2} if kind == "flat" else {len(side) for side in SIDES})


def test_robot_from_two_folders(tmp_path, monkeypatch):
    """Each part keeps its own files, though those of both have the same names, from whatever folder one asks."""
    monkeypatch.chdir(tmp_path)
    arena = with_robot(from_two_folders(tmp_path), pos=(2, 0, 1))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    params = arena.nominal_params()
    has_both_parts(arena.compile(params), "r_")
    has_both_parts(mujoco.MjModel.from_xml_string(arena.to_xml(params)), "r_")
    has_both_parts(arena.tile(jax.tree.map(lambda x: x[None], params)).model, "world0_r_")
    arena.export(params, tmp_path / "world")
    shutil.rmtree(tmp_path / "one")
    shutil.rmtree(tmp_path / "two")
    has_both_parts(mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml")), "r_")


def test_unreadable_file(tmp_path):
    """What cannot be read is said, not that the folder cannot be written."""
    xml, params = '<mujoco><asset><mesh file="/nowhere/a.obj"/></asset></mujoco>', mja.TableArena().nominal_params()
    with pytest.raises(FileNotFoundError, match=r"^Cannot read '/nowhere/a.obj', which the arena needs: No such file"):
        export.write(tmp_path / "world", xml, {}, params, {})
    assert not (tmp_path / "world").exists()


SCENE = """<mujoco><compiler meshdir="assets"/><asset><mesh name="part" file="part.obj"/></asset>
  <worldbody><body name="desk" pos="0 2 .8"><geom name="top" type="box" size=".4 .4 .02"/></body>
  <body><joint/><geom type="mesh" mesh="part" pos="2 0 1"/></body></worldbody></mujoco>"""
RELATIVE = {
    "xml": lambda file: mja.TableArena(xml=file, objects=[CUBE]),
    "from_xml": lambda file: mja.Arena.from_xml(file, ["desk"], objects=[CUBE]),
    "text": lambda _: mja.TableArena(xml=SCENE, objects=[CUBE]),
    "robot": lambda file: with_robot(file),
    "object": lambda _: mja.TableArena(objects=[mja.Object("thing", "mjcf", file="thing.xml")]),
}


@pytest.mark.parametrize("given", RELATIVE)
def test_relative_paths(given, tmp_path, monkeypatch):
    """Files are found after the current folder has changed."""
    monkeypatch.chdir(tmp_path)
    thing = write_part(tmp_path, "assets", 0.1, 0).read_text().replace("<joint/>", "")
    (tmp_path / "thing.xml").write_text(thing)
    file = pathlib.Path("scene.xml")
    file.write_text(SCENE)
    arena = RELATIVE[given](file)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert arena.mj_model.nmesh == 1
    assert arena.compile(arena.nominal_params()).nmesh == 1
    assert mujoco.MjModel.from_xml_string(arena.to_xml(arena.nominal_params())).nmesh == 1


OPTION = '<mujoco><option timestep=".004" {}</option><worldbody><body><joint/><geom size=".05" pos="3 0 1"/></body></worldbody></mujoco>'
WORLDWIDE = {
    "contact": ('><flag contact="disable" warmstart="disable"/>', "contacts disabled (disableflags)"),
    "constraint": ('><flag constraint="disable"/>', "constraints disabled, contacts too (disableflags)"),
    "weight": ('><flag gravity="disable"/>', "gravity disabled (disableflags)"),
    "override": ('o_margin="0.1"><flag override="enable"/>', "parameters of all contacts overridden (enableflags)"),
    "gravity": ('gravity="0 0 0">', "gravity=[0.0, 0.0, 0.0] (arena: [0.0, 0.0, -9.81])"),
    "density": ('density="3000">', "density=3000.0 (arena: 0.0)"),
    "viscosity": (
        'viscosity="2" wind="1 0 0">',
        "viscosity=2.0 (arena: 0.0), wind=[1.0, 0.0, 0.0] (arena: [0.0, 0.0, 0.0])",
    ),
}


@pytest.mark.parametrize("option", WORLDWIDE)
def test_options_that_change_the_arena(option, tmp_path):
    """They are taken over with a warning, or without one if asked for, or left out; the solver's are taken in any case."""
    xml, words = OPTION.format(WORLDWIDE[option][0]), WORLDWIDE[option][1]
    said = (
        f'`robot` changes options of the whole arena: {words}; with options="solver" the arena keeps its own, '
        'with options="all" it takes these without a warning.'
    )
    with pytest.warns(UserWarning, match="changes options of the whole arena") as warned:
        silent = with_robot(xml).mj_model.opt
    assert [str(w.message) for w in warned] == [said]
    everything, kept = (with_robot(xml, options=choice).mj_model.opt for choice in ("all", "solver"))
    alone, plain = mujoco.MjModel.from_xml_string(xml).opt, mujoco.MjModel.from_xml_string("<mujoco/>").opt
    for name in ("timestep", "disableflags", "enableflags", "gravity", "density", "viscosity", "wind"):
        np.testing.assert_array_equal(getattr(silent, name), getattr(alone, name), err_msg=name)
        np.testing.assert_array_equal(getattr(everything, name), getattr(alone, name), err_msg=name)
        want = 0.004 if name == "timestep" else getattr(plain, name)
        if (option, name) == ("contact", "disableflags"):
            want = mujoco.mjtDisableBit.mjDSBL_WARMSTART
        np.testing.assert_array_equal(getattr(kept, name), want, err_msg=name)
    other = with_robot(xml, options="all")
    with pytest.warns(
        UserWarning, match=r"^`other` changes options of the whole arena.* merged arena's `spec.option` can be set"
    ):
        mja.TableArena().merge(other, "b_", pos=(9, 0, 0))


def test_options_of_the_solver_are_logged(caplog):
    """Those of time, integrator and solver that an arena takes over, in words; not what a warning names, or what is left out."""
    xml = OPTION.format('cone="elliptic" gravity="0 0 -1"><flag eulerdamp="disable" contact="disable"/>')
    taken = "cone=elliptic (arena: pyramidal), disableflags=eulerdamp (arena: none), timestep=0.004 (arena: 0.002)"
    for options in ("all", "solver"):
        caplog.clear()
        with caplog.at_level(logging.INFO, logger="mjx_arenas"):
            with_robot(xml, options=options)
        assert [r.getMessage() for r in caplog.records] == [f"The arena takes over options of `robot`: {taken}."]
    robot = with_robot(xml, options="solver")
    caplog.clear()
    with caplog.at_level(logging.INFO, logger="mjx_arenas"):
        mja.TableArena().merge(robot, "b_", pos=(9, 0, 0))
    assert [r.getMessage() for r in caplog.records] == [f"The arena takes over options of `other`: {taken}."]


def test_options_of_a_file(tmp_path):
    """The choice is saved with the arena, and a wrong one is answered."""
    arena = with_robot(OPTION.format('density="3000">'), options="solver")
    mja.save(tmp_path / "arena.yaml", arena)
    assert mja.load(tmp_path / "arena.yaml")[0].mj_model.opt.density == 0
    with pytest.raises(ValueError, match=r"^`options` must be 'all', 'solver' or None, got 'none'\.$"):
        with_robot(OPTION.format(">"), options="none")


def test_options_as_in_the_arena():
    """Nothing is said where the arena has the same already, or another one of its own, but for that."""
    arena = mja.TableArena(objects=[CUBE])
    arena.spec.option.density = 3000
    arena.attach(OPTION.format('density="3000">'))
    arena = mja.TableArena(objects=[CUBE])
    arena.spec.option.density = 2
    with pytest.warns(UserWarning, match="has other options than the arena. The arena's are used: density=3000"):
        arena.attach(OPTION.format('density="3000">'))


GROUPS = """<mujoco><compiler inertiagrouprange="2 3"/><asset><mesh name="m" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1"/></asset>
  <default><geom group="1"/></default><worldbody>
  <body name="desk" pos="0 0 .8"><geom name="top" type="box" size=".4 .4 .02"/></body>
  <body name="arm" pos="3 0 1"><joint/><geom size=".1" pos=".2 0 0"/><geom name="counts" type="box" size=".1 .1 .2" group="2"/>
    <geom type="mesh" mesh="m" mass="3"/>
    <body name="hand" pos="0 0 .3"><joint/><geom type="mesh" mesh="m" group="3"/><geom type="capsule" size=".1 .1"/>
      <site name="tip" pos="0 0 .2"/></body></body></worldbody></mujoco>"""


def test_groups_that_have_mass():
    """Beside objects, bodies of a scene that counts some groups of geoms alone are as heavy as before; objects, too."""
    alone = mujoco.MjModel.from_xml_string(GROUPS)
    scene = mja.Arena.from_xml(GROUPS, ["desk"], objects=[CUBE])
    base = mja.TableArena(xml=GROUPS.replace('pos="0 0 .8"', 'pos="0 5 .8"'), objects=[CUBE])
    robot = with_robot(GROUPS.replace('pos="0 0 .8"', 'pos="0 5 .8"'))
    for arena, prefix in ((scene, ""), (base, ""), (robot, "r_")):
        for name in ("arm", "hand"):
            want, got = alone.body(name), arena.mj_model.body(prefix + name)
            for field in ("mass", "inertia", "ipos", "iquat"):
                np.testing.assert_allclose(getattr(got, field), getattr(want, field), rtol=1e-12, err_msg=field)
        assert arena.mj_model.body("cube").mass[0] == pytest.approx(0.125)
