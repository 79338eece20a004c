"""Cameras and lights that aim at what is absent in a world, or are on it: as in the compiled world, and told of."""

import functools
import warnings

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.pixels.poses import poses

SCENE = """<mujoco><worldbody><light name="sun" pos="0 0 4"/><geom name="floor" type="plane" size="3 3 .1"/>
<camera name="at_post" mode="targetbody" target="post" pos="1 -1 2" euler="20 30 0"/>
<light name="on_cap" mode="targetbodycom" target="cap" pos="1 1 3" dir=".1 .2 -1"/>
<body name="post" pos="-1 0 .3" euler="0 20 0"><geom name="post" type="capsule" size=".1 .2"/>
<camera name="down" mode="targetbody" target="cap" pos=".5 0 .5"/>
<body name="cap" pos="0 0 .4"><geom name="cap" size=".12"/></body></body></worldbody></mujoco>"""
ALL = {
    "table_active": mja.Bernoulli([1.0, 0.5]),
    "object_active": mja.Bernoulli(0.5),
    "object_tables": mja.Choice([0, 1]),
    "terms": {"there": mja.Bernoulli(0.5), "rack.active": mja.Bernoulli(0.5), "rack.pieces_active": mja.Bernoulli(0.5)},
}
SPIN = [0.9, 0.3, -0.2, 0.1]
TARGETS = ("cube", "ball", "table1", "post", "cap", "rack", "rack_board1")


@pytest.fixture(scope="module")
def arena():
    """Cameras and lights that aim at objects, a table, a body with another on it, and furniture; lights on an object and on a table."""
    made = mja.MultiTableArena(
        xml=SCENE,
        table_offsets=[[0, -0.6, 0.8], [0, 0.6, 0.8]],
        objects=[mja.Object("cube", full_size=0.1), mja.Object("ball", "sphere", 0.1)],
    )
    made.add_part(furniture.Shelf("rack", pos=(2, 0, 0), heights=(0.3, 0.8)))
    made.vary(there=dr.Term("body.active", ["post", "cap"]))
    spec, modes = made.spec, mujoco.mjtCamLight
    for k, target in enumerate(TARGETS):
        mode = (modes.mjCAMLIGHT_TARGETBODY, modes.mjCAMLIGHT_TARGETBODYCOM)[k % 2]
        at = {"pos": [1 + 0.1 * k, 0.2, 1.9], "mode": mode, "targetbody": target}
        spec.worldbody.add_camera(name=f"camera_{target}", quat=SPIN, **at)
        spec.body("table0").add_light(name=f"light_{target}", dir=[0.3, 0.2, -1], **at)
    for mode in ("TRACK", "TRACKCOM", "FIXED"):
        spec.body("cube").add_light(name=f"own_{mode}", pos=[0, 0, 0.5], mode=getattr(modes, f"mjCAMLIGHT_{mode}"))
    spec.body("table1").add_light(name="lamp", pos=[0, 0, 1])
    return made


@pytest.fixture(scope="module")
def worlds(arena, impl):
    """Worlds with and without what is aimed at, and each in C."""
    keys = mja.world_keys(0, range(14))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        batch = arena.randomize(arena.put_model(impl), keys, mja.ArenaRanges(**ALL))
    data = mja.make_data(batch, keys)
    return batch, data, [arena.c_world(batch.world(i), mja.take(data, i)) for i in range(len(keys))]


def elements(model, kind):
    """Ids of cameras or lights by their names."""
    return {
        getattr(model, kind)(i).name: i for i in range(getattr(model, f"n{kind[:3] if kind == 'camera' else kind}"))
    }


@pytest.mark.slow
@pytest.mark.slow_on("jax")
def test_as_compiled(arena, worlds):
    """Where they are, and what they look at, of all that the compiled worlds have."""
    pytest.importorskip("warp")
    batch, data, in_c = worlds
    drawn = batch
    if batch.model.impl.value == "jax":
        drawn = arena.batch(arena.put_model("warp"), batch.params)
    one = jax.vmap(functools.partial(poses, batch.record.layout), in_axes=(0, batch.in_axes, drawn.in_axes, 0))
    found, fixed = jax.jit(one)(batch.params, batch.model, drawn.model, data), set()
    for i, (model, c) in enumerate(in_c):
        for kind, prefix, turn in (("camera", "cam", "xmat"), ("light", "light", "xdir")):
            own = elements(arena.mj_model, kind)
            for name, k in elements(model, kind).items():
                for field in (f"{prefix}_xpos", f"{prefix}_{turn}"):
                    got, want = np.asarray(getattr(found, field)[i, own[name]]), getattr(c, field)[k]
                    np.testing.assert_allclose(got.reshape(-1), want.reshape(-1), atol=2e-6, err_msg=f"{i} {name}")
                aimed = getattr(arena.mj_model, f"{prefix}_targetbodyid")[own[name]] >= 0
                fixed |= {(name, bool(getattr(model, f"{prefix}_mode")[k]))} if aimed else set()
    names = {name for name, _ in fixed}
    assert fixed == {
        (name, aims) for name in names for aims in (True, False)
    }  # each aims in some worlds, in others not
    assert len(names) == 2 * len(TARGETS) + 3


@pytest.mark.slow_on("jax")
def test_lights_of_what_is_absent(arena, worlds):
    """They are off, as the compiled world has none, and all others on."""
    batch, _, in_c = worlds
    own, active = elements(arena.mj_model, "light"), np.asarray(batch.model.light_active)
    assert active.shape == (len(in_c), len(own))
    for i, (model, _) in enumerate(in_c):
        assert {name for name, k in own.items() if active[i, k]} == set(elements(model, "light")), i
    assert not active[:, [own["own_TRACK"], own["lamp"]]].all(axis=0).any()


@pytest.mark.slow
def test_pictures(impl):
    """Of a camera on a cube that is absent in some worlds: there it sees what the compiled world's camera sees."""
    pytest.importorskip("warp")
    arena = mja.TableArena(objects=[mja.Object("cube", full_size=0.1), mja.Object("ball", "sphere", 0.1)])
    at = {"mode": mujoco.mjtCamLight.mjCAMLIGHT_TARGETBODY, "targetbody": "cube"}
    arena.spec.worldbody.add_camera(name="aim", pos=[0.3, 0, 1.5], **at)
    keys, ranges = mja.world_keys(0, range(4)), mja.ArenaRanges(object_active=mja.Bernoulli([0.5, 1.0]))
    with pytest.warns(UserWarning, match="^`ranges`: camera 'aim' aims at 'cube', which is absent in some worlds"):
        batch = arena.randomize(arena.put_model(impl), keys, ranges)
    data = mja.make_data(batch, keys)
    draw = arena.renderer({"aim": (48, 48)}, segmentation=True, rgb=False)
    seen = np.asarray(draw(batch, data)["aim"].segmentation)
    assert set(np.asarray(batch.params.object_active[:, 0])) == {True, False}
    labels = np.array([*draw.labels, ""])
    for i in np.unique(batch.params.object_active[:, 0], return_index=True)[1].tolist():  # a world of each kind
        picture = seen[i]
        model, c = arena.c_world(batch.world(i), mja.take(data, i))
        with mujoco.Renderer(model, 48, 48) as one:
            one.enable_segmentation_rendering()
            one.update_scene(c, "aim")
            ids = one.render()[..., 0]
        want = {model.geom(g).name.split("_")[0] for g in np.unique(ids[ids >= 0])}
        assert {name.split("_")[0] for name in labels[np.unique(picture)] if name} == want, i


TOLD = (
    "`ranges`: {} aims at '{}', which is absent in some worlds. There it has its own {} in pictures and in compiled worlds, while "
    "`data.{}` of MJX aims at where '{}' is parked."
)


def told(*targets, lights=True):
    """What is said of these targets."""
    own = {"at_post": "post", "on_cap": "cap"} | {f"{kind}_{t}": t for kind in ("camera", "light") for t in TARGETS}
    found = []
    for name, target in own.items():
        kind = "light" if name.startswith("light") or name == "on_cap" else "camera"
        what = ("orientation", "cam_xmat") if kind == "camera" else ("direction", "light_xdir")
        found += [TOLD.format(f"{kind} '{name}'", target, *what, target)] if target in targets else []
    return set(found)


CASES = {
    "a cube": ({"object_active": mja.Bernoulli([0.5, 1.0])}, ("cube",)),
    "what stands on a table": ({"table_active": mja.Bernoulli([1.0, 0.5])}, ("table1",)),
    "the table below": (
        {"table_active": mja.Bernoulli([1.0, 0.5]), "object_tables": mja.Fixed([0, 1])},
        ("table1", "ball"),
    ),
    "a part": ({"terms": {"rack.active": mja.Bernoulli(0.5)}}, ("rack", "rack_board1")),
    "a board": ({"terms": {"rack.pieces_active": mja.Bernoulli([1.0, 0.5])}}, ("rack_board1",)),
    "all that hangs on it": ({"terms": {"there": mja.Bernoulli([0.5, 1.0])}}, ("post", "cap")),
    "what hangs on it": ({"terms": {"there": mja.Bernoulli([1.0, 0.5])}}, ("cap",)),
    "all there": ({"object_active": mja.Fixed(True), "terms": {"there": mja.Bernoulli(1.0)}}, ()),
    "nothing of presence": ({"object_masses": mja.Uniform(0.1, 0.2)}, ()),
}


@pytest.mark.parametrize("case", CASES)
def test_warned_of(arena, case):
    """Each that is there in worlds without what it aims at; `down` goes with the post, and is told of for the cap alone."""
    given, targets = CASES[case]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        arena.check_ranges(mja.ArenaRanges(**given))
    also = (
        {TOLD.format("camera 'down'", "cap", "orientation", "cam_xmat", "cap")} if case == "what hangs on it" else set()
    )
    assert {str(w.message) for w in caught} == told(*targets) | also
