"""Pictures: what is drawn stands where the world has it."""

import operator
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from gl import needs_gl
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas.viz import render

WITHIN = 1e-5  # [m], and of entries of rotations: float32 of numbers below 4, through a few operations


def drawn(drawing, model, c, kind):
    """What a drawing shows of the geoms or sites of a model, in all groups: (n,) ids and (n, ...) of each quantity."""
    option = mujoco.MjvOption()
    option.geomgroup[:] = option.sitegroup[:] = 1
    scene = drawing.update(model, c, option=option)
    found = [g for g in scene.geoms[: scene.ngeom] if g.objtype == kind]
    return [np.array([getattr(g, name) for g in found]) for name in ("objid", "pos", "mat", "size", "rgba")]


def drawn_size(kind, size):
    """How large MuJoCo draws a shape of `geom_size` (3,)."""
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return size[[0, 0, 0]]
    return (
        size[[0, 0, 1]]
        if mujoco.mjtGeom(kind) in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER)
        else size
    )


@pytest.mark.xslow_on("jax")
@needs_gl
@pytest.mark.slow
def test_picture_parity(arena, batch, keys):
    """Every geom and site of the renderer's scene stands where the batched data has it, with the batched size and colour."""
    start = mja.make_data(batch, keys)
    data = mja.step(batch, start)  # whose kinematics are those of the start
    xpos, xmat, site_xpos, site_xmat = map(np.asarray, (data.geom_xpos, data.geom_xmat, data.site_xpos, data.site_xmat))
    sizes, rgba = np.asarray(batch.model.geom_size), np.asarray(batch.model.geom_rgba)
    with render.Drawing(arena.mj_model, 8, 8) as drawing:
        for i in range(12):
            model, c = arena.c_world(batch.world(i), mja.take(start, i))
            geoms, _, _, _, colour = drawn(drawing, model, c, mujoco.mjtObj.mjOBJ_GEOM)
            np.testing.assert_array_equal(geoms, np.flatnonzero(rgba[i, :, 3]))
            plain = model.geom_matid[geoms] < 0
            np.testing.assert_allclose(colour[plain], rgba[i, geoms][plain], rtol=0, atol=1e-6)

            model.geom_rgba[:, 3] = model.site_rgba[:, 3] = 1  # what is transparent is not in a scene
            geoms, pos, mat, size, _ = drawn(drawing, model, c, mujoco.mjtObj.mjOBJ_GEOM)
            np.testing.assert_array_equal(geoms, np.arange(model.ngeom))
            np.testing.assert_allclose(pos, xpos[i], rtol=0, atol=WITHIN)
            np.testing.assert_allclose(mat, xmat[i], rtol=0, atol=WITHIN)
            expected = [drawn_size(kind, s) for kind, s in zip(model.geom_type, sizes[i], strict=True)]
            np.testing.assert_allclose(size, expected, rtol=0, atol=WITHIN)
            sites, pos, mat, _, _ = drawn(drawing, model, c, mujoco.mjtObj.mjOBJ_SITE)
            np.testing.assert_array_equal(sites, np.arange(model.nsite))
            np.testing.assert_allclose(pos, site_xpos[i], rtol=0, atol=WITHIN)
            np.testing.assert_allclose(mat, site_xmat[i], rtol=0, atol=WITHIN)


def scene():
    """A red cube on a table with legs, a green ball on one without, from above; a camera that looks down."""
    objects = [
        mja.Object("cube", full_size=0.2, rgba=(1, 0, 0, 1), pos=(0, 0)),
        mja.Object("ball", "sphere", 0.2, on=1, rgba=(0, 1, 0, 1), pos=(0, 0)),
    ]
    arena = mja.MultiTableArena([[0, -0.6, 0.8], [0, 0.6, 0.8]], objects=objects, has_legs=[True, False])
    arena.spec.worldbody.add_camera(name="above", pos=(0, 0, 3))
    return arena


def pixels(picture, channel):
    """(n, 2) rows and columns of the pixels that have one colour."""
    others = np.delete(picture.astype(int), channel, axis=2).max(2)
    return np.argwhere(picture[..., channel] > 2 * others + 40)


@pytest.mark.slow
@needs_gl
def test_pixels():
    """A picture has the size that is asked for, and the objects' colours where they stand; nothing of what is absent."""
    arena = scene()
    params = arena.nominal_params()
    picture = arena.render(params, camera="above", width=1000, height=700)
    assert picture.shape == (700, 1000, 3)
    assert picture.dtype == np.uint8
    model, focal = arena.mj_model, 350 / np.tan(np.deg2rad(arena.mj_model.vis.global_.fovy / 2))
    assert model.cam_fovy[model.camera("above").id] == model.vis.global_.fovy == 45
    for channel, y in ((0, -0.6), (1, 0.6)):  # the camera's right is x, its up is y
        middle = pixels(picture, channel).mean(0)
        row = 349.5 - focal * y / (3 - 0.9)
        assert abs(middle[0] - row) < 15  # sides of objects are seen, too
        assert abs(middle[1] - 499.5) < 4
    top = picture[550, 400].astype(int)
    assert np.ptp(top) < 40
    assert top.min() > 100

    gone = params._replace(table_active=jnp.array([True, False]))
    less = arena.render(gone, camera="above", width=1000, height=700)
    assert len(pixels(less, 1)) == 0
    assert len(pixels(less, 0)) == len(pixels(picture, 0))
    warm = [(p[..., 0].astype(int) - p[..., 2])[150:250, 380:620].mean() for p in (picture, less)]
    assert warm[0] > 10  # a table's colour
    assert warm[1] < 3  # the floor is grey
    bare = arena.render(params._replace(object_active=jnp.array([False, True])), camera="above", width=1000, height=700)
    assert len(pixels(bare, 0)) == 0

    one, c = arena.c_world(gone)
    assert one.nbody == 3
    c.qpos[2] += 0.3
    for camera in (None, -1, 0, "birdview", mujoco.MjvCamera()):
        assert arena.render(gone, c, camera, 64, 48).shape == (48, 64, 3)


def test_state_of_a_world(impl):
    """Data of one world, on an implementation or in C, of all that may be there or of what is, is one state."""
    drawer = """<mujoco><worldbody><body name="case"><geom type="box" size=".1 .1 .05"/><body name="tray" pos="0 0 .1">
      <joint name="slide" type="slide" axis="1 0 0"/><geom type="box" size=".05 .05 .02"/></body></body></worldbody>
      <actuator><intvelocity name="push" joint="slide" actrange="-1 1"/></actuator>
      <equality><joint joint1="slide" active="false"/></equality></mujoco>"""
    objects = [mja.Object(name, "mjcf", file=mujoco.MjSpec.from_string(drawer), on=t) for t, name in enumerate("ab")]
    arena = mja.MultiTableArena([[0, 0, 0.8], [1.5, 0, 0.8]], objects=objects)
    params = arena.nominal_params()._replace(table_active=jnp.array([False, True]))
    full = mujoco.MjData(arena.mj_model)
    rng = np.random.default_rng(0)
    for name in ("qpos", "qvel", "ctrl", "act", "xfrc_applied"):
        getattr(full, name)[...] = rng.normal(size=getattr(full, name).shape)
    full.eq_active[:] = [False, True]
    full.time = 1.5
    model, c = arena.c_world(params, full)
    assert (model.nq, model.nv, model.nu, model.na, model.neq) == (8, 7, 1, 1, 1)
    np.testing.assert_array_equal(c.qpos, full.qpos[8:])
    np.testing.assert_array_equal(c.qvel, full.qvel[7:])
    np.testing.assert_array_equal(c.xfrc_applied, full.xfrc_applied[[0, 2, 6, 7, 8]])
    assert (c.ctrl, c.act, c.time, c.eq_active) == (full.ctrl[1], full.act[1], 1.5, 1)
    again = arena.c_world(params, c)[1]
    data = mjx.make_data(arena.mj_model, impl=impl)
    data = data.replace(**{n: jnp.asarray(getattr(full, n), jnp.float32) for n in ("qpos", "qvel", "ctrl", "act")})
    device = arena.c_world(params, data)[1]
    for name in ("qpos", "qvel", "ctrl", "act"):
        np.testing.assert_array_equal(getattr(again, name), getattr(c, name))
        np.testing.assert_allclose(getattr(device, name), getattr(c, name), rtol=1e-6)


@pytest.mark.slow
def test_key_places_as_in_a_batch(arena, batch, keys):
    """A key places the objects of one world in C as `make_data` does those of many; a state in C is taken over whole."""
    data = mja.make_data(batch, keys)
    for i in range(4):
        _, c = arena.c_world(batch.world(i), key=keys[i])
        _, want = arena.c_world(batch.world(i), mja.take(data, i))
        np.testing.assert_allclose(c.qpos, want.qpos, rtol=0, atol=1e-6)  # float32's numbers of a few metres
        np.testing.assert_array_equal(arena.c_world(batch.world(i), c)[1].qpos, c.qpos)


def test_state_of_a_world_without_a_table(arena):
    """An absent table has no positions of its own: as many positions do not mean as many bodies."""
    params = arena.nominal_params()._replace(
        table_active=np.array([True, True, False]), object_tables=np.zeros(len(arena.objects), int)
    )
    _, c = arena.c_world(params)
    assert len(c.qpos) == arena.mj_model.nq
    np.testing.assert_array_equal(arena.c_world(params, c)[1].xpos, c.xpos)


@pytest.mark.slow
def test_take(arena, batch, keys):
    """One world or a few of parameters and of data are those that slices give."""
    data = mja.make_data(batch, keys)
    one, few = mja.take(data, 3), mja.take(data, [3, 0])
    assert mja.take(batch.params, [3, 0]).table_rots.tolist() == batch.params.table_rots[np.array([3, 0])].tolist()
    for name in ("qpos", "qvel", "geom_xpos", "time"):
        np.testing.assert_array_equal(getattr(one, name), getattr(data, name)[3])
        np.testing.assert_array_equal(getattr(few, name), getattr(data, name)[np.array([3, 0])])
    for part in (slice(0, 4), slice(None, None, -2), slice(-1, None)):
        for some in (mja.take(batch.params, part), mja.take(batch, part).params):
            np.testing.assert_array_equal(some.table_rots, batch.params.table_rots[part])
    assert mja.take(batch, slice(0, 4)).n_worlds == 4
    np.testing.assert_array_equal(mja.take(data, [-1, 0]).qpos, data.qpos[np.array([-1, 0])])
    np.testing.assert_array_equal(batch.world(-1).table_rots, batch.params.table_rots[-1])
    exact = arena.nominal_params()
    numpy = mja.take(jax.tree.map(lambda x: np.stack([x, x]).astype(np.float64), exact), 1)
    assert numpy.table_rots.dtype == np.float64


@pytest.mark.slow
def test_take_of_a_batch(arena, batch, keys):
    """Some worlds of a batch are the batch of their parameters, in any order; one of them, too."""
    some = mja.take(batch, [3, 0])
    same = arena.batch(arena.put_model(batch.model.impl.value), mja.take(batch.params, [3, 0]))
    assert some.n_worlds == 2
    for name in batch.fields:
        rows = operator.attrgetter(name)
        np.testing.assert_array_equal(rows(some.model), rows(batch.model)[np.array([3, 0])])
        np.testing.assert_allclose(rows(some.model), rows(same.model), rtol=1e-5, atol=1e-6)
    assert mja.make_data(some).qpos.shape == (2, arena.mj_model.nq)
    assert mja.take(some, [1]).world(0).table_rots.tolist() == some.params.table_rots[1].tolist()


@pytest.mark.slow
@needs_gl
def test_contact_sheet(arena, batch, keys):
    """A picture in a sheet is the picture alone."""
    few = [2, 7]
    data = mja.take(mja.make_data(batch, keys), few)
    sheet = np.asarray(arena.contact_sheet(mja.take(batch.params, few), data, ["", ""], width=64, height=48))
    assert sheet.shape == (48 + 12, 2 * 64 + 18, 3)
    alone = arena.render(batch.world(7), mja.take(data, 1), width=64, height=48)
    np.testing.assert_array_equal(sheet[6:-6, 76:140], alone)


@pytest.mark.slow
@needs_gl
def test_gl_is_chosen_after_mujoco():
    """Without a screen, a process that has imported MuJoCo first, and set nothing, gets its picture."""
    code = (
        "import mujoco, mjx_arenas as mja; arena = mja.TableArena();"
        "picture = arena.render(arena.nominal_params(), width=64, height=48); print(picture.shape, picture.std() > 10)"
    )
    hidden = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
    environ = {k: v for k, v in os.environ.items() if k not in hidden}
    run = subprocess.run([sys.executable, "-c", code], env=environ, capture_output=True, text=True, check=True)
    assert run.stdout == "(48, 64, 3) True\n"


@pytest.mark.parametrize("chosen", ["disable", "osmesa"])
def test_without_gl(chosen, monkeypatch):
    """Where OpenGL is missing or does not work, one sentence says so."""

    def fails(*_):
        raise mujoco.FatalError("no\ncontext")

    monkeypatch.setattr(mujoco, "Renderer", fails)
    monkeypatch.setattr(render, "choose_gl", lambda: None if chosen == "disable" else chosen)
    arena = mja.TableArena()
    message = {
        "disable": "Pictures cannot be drawn: OpenGL is missing here "
        "(on Debian and Ubuntu: apt install libegl1 libgl1-mesa-dri).",
        "osmesa": "Pictures cannot be drawn: OpenGL does not work with MUJOCO_GL=osmesa: no context",
    }
    with pytest.raises(RuntimeError) as error:
        arena.render(arena.nominal_params())
    assert str(error.value) == message[chosen]


@pytest.mark.slow
@needs_gl
def test_video(tmp_path):
    """A video has a frame for each step of its clock, moves as the worlds do, and leaves nothing behind if it fails."""
    av = pytest.importorskip("av")
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.2, rgba=(1, 0, 0, 1))])
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 2), mja.ArenaRanges())
    data = mja.make_data(batch)
    data = data.replace(qpos=data.qpos.at[:, 2].set(jnp.array([0.95, 1.05])))
    path = tmp_path / "drop.mp4"
    view = render.overview(arena.table_names, [arena.c_world(batch.world(1), mja.take(data, 1))], 161 / 121)
    mja.video(
        batch,
        data,
        path,
        seconds=np.float32(0.2),
        fps=np.int64(10),
        camera=view,
        labels=["", ""],
        width=161,
        height=121,
    )
    with av.open(str(path)) as file:
        frames = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
        assert float(file.streams.video[0].average_rate) == pytest.approx(10)
    assert len(frames) == 3
    assert frames[0].shape == (132, 340, 3)
    for frame in frames:
        for world, columns in enumerate((slice(6, 167), slice(173, 334))):
            alone = arena.render(batch.world(world), mja.take(data, world), view, width=161, height=121)
            seen, expected = (pixels(picture, 0) for picture in (frame[6:127, columns], alone))
            np.testing.assert_allclose(seen.mean(0), expected.mean(0), atol=1)
            assert len(seen) == pytest.approx(len(expected), rel=0.1)  # the encoder blurs colours
        data = mja.rollout(batch, data, 50)

    with pytest.raises(ValueError, match=r"^`camera` must be"):
        mja.video(batch, data, tmp_path / "not.mp4", seconds=0.3, fps=10, camera="nowhere")
    with pytest.raises(ValueError, match=r"^`height` must be a whole number from 1 to 16384"):
        mja.video(batch, data, tmp_path / "not.mp4", seconds=0.3, fps=10, height=0)
    assert os.listdir(tmp_path) == ["drop.mp4"]


@needs_gl
def test_all_is_in_the_frame():
    """In the camera that MuJoCo makes of it, the corners of tables, legs and objects are inside, and fill the picture."""
    arena = mja.MultiTableArena(
        [[0, -0.5, 0.5], [0, 0.7, 1.1]], [0.3, 0], objects=[mja.Object("pole", full_size=(0.05, 0.05, 0.6))]
    )
    there = arena.nominal_params()
    lower = there._replace(
        table_offsets=there.table_offsets - jnp.array([0, 0, 0.3]), has_legs=jnp.array([True, False])
    )
    twins = [arena.c_world(params) for params in (there, lower)]
    for width, height in ((160, 120), (90, 160)):
        view, places = render.overview(arena.table_names, twins, width / height), []
        with render.Drawing(arena.mj_model, width, height) as drawing:
            for model, c in twins:
                camera = drawing.update(model, c, view).camera[0]
                drawn = (model.geom_rgba[:, 3] > 0) & (model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
                signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T
                turned = np.einsum(
                    "gij,gkj->gki", c.geom_xmat[drawn].reshape(-1, 3, 3), signs * model.geom_size[drawn][:, None]
                )
                away = (c.geom_xpos[drawn][:, None] + turned).reshape(-1, 3) - camera.pos
                right = np.cross(camera.forward, camera.up)
                depth = away @ camera.forward / camera.frustum_near
                across = away @ right / depth / (camera.frustum_top * width / height)
                places.append(np.stack([across, away @ camera.up / depth / camera.frustum_top], axis=-1))
        seen = np.concatenate(places)
        assert abs(seen).max() < 1
        assert np.ptp(seen, axis=0).max() > 1.7


def test_contact_sheets_are_checked_first(monkeypatch):
    """What is wrong with a grid is said before its worlds are drawn."""
    arena = scene()
    params = jax.tree.map(lambda x: x[None], arena.nominal_params())
    monkeypatch.setattr(render, "draw_worlds", None)
    for wrong, message in (
        ({"labels": ["a", "b"]}, r"^`labels` must be one for each of the 1 pictures, got 2\.$"),
        ({"columns": 0}, r"^`columns` must be a whole number >= 1, got 0\.$"),
    ):
        with pytest.raises(ValueError, match=message):
            arena.contact_sheet(params, **wrong)


@needs_gl
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda a, p: a.render(p, camera="top"),
            "`camera` must be 'frontview', 'birdview', 'agentview', 'sideview', 'above', an id from 0 to 4, "
            "-1 (MuJoCo's free camera), an MjvCamera or None, got 'top'.",
        ),
        (
            lambda a, p: a.render(p, camera="agentveiw"),
            "`camera` must be 'frontview', 'birdview', 'agentview', 'sideview', 'above', an id from 0 to 4, "
            "-1 (MuJoCo's free camera), an MjvCamera or None, got 'agentveiw': 'agentview' may be meant.",
        ),
        (
            lambda a, p: a.render(p, camera="topview"),
            "`camera` must be 'frontview', 'birdview', 'agentview', 'sideview', 'above', an id from 0 to 4, "
            "-1 (MuJoCo's free camera), an MjvCamera or None, got 'topview'.",
        ),
        (
            lambda a, p: a.render(p, camera=5),
            "`camera` must be 'frontview', 'birdview', 'agentview', 'sideview', 'above', an id from 0 to 4, "
            "-1 (MuJoCo's free camera), an MjvCamera or None, got 5.",
        ),
        (
            lambda a, p: a.render(p, width=0),
            "`width` must be a whole number from 1 to 16384 [pixels], got 0.",
        ),
        (
            lambda a, p: a.render(p, np.zeros(14)),
            "`data` must be an mjx.Data, a mujoco.MjData or None, got ndarray.",
        ),
        (
            lambda a, p: a.render(p, mujoco.MjData(mja.TableArena().mj_model)),
            "`data` must be of this world, with 14 positions, got 0.",
        ),
        (
            lambda a, p: a.contact_sheet(p),
            "`params` must be of many worlds, (W, ...), got one: jax.tree.map(lambda x: x[None], params) adds the axis.",
        ),
        (
            lambda a, p: a.contact_sheet(jax.tree.map(lambda x: x[None], p), labels=["a", "b"]),
            "`labels` must be one for each of the 1 pictures, got 2.",
        ),
        (lambda a, p: mja.take(p, 0), "`worlds` must be of many worlds, (W, ...) with the same W in all arrays."),
        (
            lambda a, p: mja.take(jax.tree.map(lambda x: x[None], p), 1),
            "`index` must be one number from -1 to 0, a list of them or a slice, got 1.",
        ),
        (
            lambda a, p: mja.take(jax.tree.map(lambda x: x[None], p), 0.5),
            "`index` must be one number from -1 to 0, a list of them or a slice, got 0.5.",
        ),
        (
            lambda a, p: mja.take(jax.tree.map(lambda x: x[None], p), slice(1, 4)),
            "`index` must be one number from -1 to 0, a list of them or a slice, got slice(1, 4, None).",
        ),
    ],
)
def test_bad_use(call, message):
    arena = scene()
    with pytest.raises((ValueError, TypeError, IndexError)) as error:
        call(arena, arena.nominal_params())
    assert str(error.value).startswith(message)
