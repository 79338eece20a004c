"""Objects in any pose in which they rest: how likely each is, where they lie, that they stay there, and that worlds are as compiled."""

import functools
import itertools
import pathlib

import jax
import mujoco
import numpy as np
import oracle
import pytest
from worlds import take

import mjx_arenas as mja
from mjx_arenas.build import resting
from mjx_arenas.record.elsewhere import elsewhere
from mjx_arenas.sample import placement

pytestmark = pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change")
WEDGE = pathlib.Path(__file__).parent / "data" / "wedge.obj"
HAMMER = """<mujoco><worldbody><body name="hammer" pos=".01 0 .02" euler="0 0 30">
<geom name="head" type="box" size=".02 .045 .02" density="7000"/>
<body name="end" pos=".07 0 0"><geom name="handle" type="box" size=".06 .01 .012" density="700"/>
<geom name="pin" type="capsule" size=".004 .01" pos="-.05 0 0"/></body></body></worldbody></mujoco>"""
"""Two boxes, and a capsule within them."""


def spec(text):
    return mujoco.MjSpec.from_string(text)


OBJECTS = (
    mja.Object("brick", full_size=(0.12, 0.06, 0.03), pose="resting"),
    mja.Object("can", "cylinder", (0.06, 0.06, 0.1), pose="resting"),
    mja.Object("rod", "capsule", (0.12, 0.03, 0.03), pose="resting"),
    mja.Object("wedge", "mesh", file=WEDGE, pose="resting"),
    mja.Object("hammer", "mjcf", file=spec(HAMMER), pose="resting"),
    mja.Object("plain", "mesh", file=WEDGE, full_size=(0.08, 0.05, 0.04)),
    mja.Object(
        "thing",
        variants=[
            mja.Object("tin", "cylinder", (0.05, 0.05, 0.08)),
            mja.Object("cheese", "mesh", file=WEDGE, full_size=(0.1, 0.06, 0.05)),
            mja.Object("ball", "sphere", 0.05),
        ],
        pose="resting",
    ),
)
POSES = {"brick": 6, "can": 3, "rod": 1, "wedge": 5, "hammer": 6, "thing": 5}
RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform(-0.1, 0.1, relative="add"),
    table_rots=mja.Uniform(-3.0, 3.0),
    object_full_sizes=mja.Uniform([0.7, 0.8, 0.9], [1.3, 1.2, 1.1], relative="scale"),
    terms={f"{name}.pose": mja.Choice(list(range(n))) for name, n in POSES.items()}
    | {"thing.variant": mja.Choice([0, 1, 2])},
)


@functools.cache
def scene(cylinders=True):
    """MJX on JAX does not collide cylinders with boxes."""
    objects = [o for o in OBJECTS if cylinders or o.name != "can"]
    return mja.TableArena((1.0, 1.0, 0.05), objects=objects[: None if cylinders else -1])


@functools.cache
def drawn(n=48):
    keys = mja.world_keys(0, range(n))
    return keys, jax.jit(jax.vmap(lambda key: scene().sample_params(key, RANGES)))(keys)


def points_of(model, c, body):
    """Corners of what collides on a body, in the world; of round shapes 720 points around each end."""
    found = []
    for g in np.flatnonzero((model.body_rootid[model.geom_bodyid] == body) & (model.geom_contype > 0)):
        size, kind = model.geom_size[g], model.geom_type[g]
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.mesh(model.geom_dataid[g])
            local = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
        elif kind == mujoco.mjtGeom.mjGEOM_BOX:
            local = np.array(list(itertools.product(*([-x, x] for x in size))))
        else:
            turn, up = np.linspace(0, 2 * np.pi, 720, endpoint=False), np.array([0, 0, 1.0])
            ring = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1) * size[0]
            half = 0.0 if kind == mujoco.mjtGeom.mjGEOM_SPHERE else size[1]
            if kind != mujoco.mjtGeom.mjGEOM_CYLINDER:
                arc = np.linspace(-np.pi / 2, np.pi / 2, 181)[:, None, None]
                ring = (np.cos(arc) * ring + np.sin(arc) * size[0] * up).reshape(-1, 3)
            local = np.concatenate([ring - half * up, ring + half * up])
        found.append(c.geom_xpos[g] + local @ c.geom_xmat[g].reshape(3, 3).T)
    return np.concatenate(found)


@pytest.mark.parametrize("size", [(0.12, 0.06, 0.03), (0.05, 0.05, 0.05), (0.02, 0.3, 0.1)])
def test_a_box_by_formula_and_as_hull(size):
    """The formula for boxes, the hull, and a plain loop over random directions give the same shares."""
    corners = np.array(list(itertools.product(*([-x / 2, x / 2] for x in size))))
    downs, shares, _ = resting.stable(corners, np.zeros(3))
    by_axis = {tuple(np.round(-down).astype(int)): share for down, share in zip(downs, shares, strict=True)}
    formula = mja.TableArena(objects=[mja.Object("box", full_size=size, pose="resting")]).poses("box")
    hits = np.random.default_rng(0).normal(size=(40000, 3))
    axis = np.argmax(np.abs(hits) / size, axis=1)
    for pose in formula:
        up = np.zeros(3)
        mujoco.mju_rotVecQuat(up, np.array([0, 0, 1.0]), pose.quat * [1, -1, -1, -1])
        assert pose.share == pytest.approx(by_axis[tuple(np.round(up).astype(int))], rel=1e-6)
        (k,) = np.flatnonzero(np.abs(up) > 0.5)
        share = (axis == k).mean() / 2
        assert pose.share == pytest.approx(share, abs=4 * np.sqrt(share / 40000))
    assert sum(pose.share for pose in formula) == pytest.approx(1)


def test_what_topples():
    """A wedge that leans over: a face on which it cannot stay hands its share on to the one on which it falls."""
    outline = (
        np.array([[0, 0], [1, 0], [3, 2], [2, 2]]) * 0.05
    )  # the middle, at x = 1.5, is not above the bottom, 0 to 1
    points = np.array([[x, y, z] for x, z in outline for y in (-0.2, 0.2)])
    middle = points.mean(0)
    downs, shares, _ = resting.stable(points, middle)
    names = np.round(downs, 3).tolist()
    assert [0, 0, -1] not in names
    assert [0, 0, 1] not in names
    assert len(downs) == 4  # two ends, two slopes
    hits = np.random.default_rng(1).normal(size=(40000, 3))
    normals = np.array([[0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], *np.array([[1, 0, -1], [-1, 0, 1]]) / 2**0.5])
    reach = (points @ normals.T).max(0) - normals @ middle
    face = np.argmax((hits @ normals.T) / reach, axis=1)
    face = np.array([0, 1, 4, 5, 4, 5])[
        face
    ]  # from the bottom it falls over the edge at x = 1, from the top over that at x = 2
    for down, share in zip(downs, shares, strict=True):
        (which,) = np.flatnonzero(np.abs(normals - down).max(1) < 1e-6)
        assert share == pytest.approx((face == which).mean(), abs=0.01)


def test_a_cylinder():
    """A plain loop over directions: which meet the ends, and which the side."""
    standing, upside_down, side = scene().poses("can")
    hits = np.random.default_rng(2).normal(size=(40000, 3))
    ends = (np.abs(hits[:, 2]) / 0.05 > np.hypot(hits[:, 0], hits[:, 1]) / 0.03).mean()
    assert standing.share == upside_down.share == pytest.approx(ends / 2, abs=0.01)
    assert side.share == pytest.approx(1 - ends, abs=0.01)
    np.testing.assert_allclose(side.full_size, (0.1, 0.06, 0.06))
    np.testing.assert_allclose(standing.full_size, (0.06, 0.06, 0.1))


def test_poses_of_each():
    """Upright comes first, where that is one; variants have their own."""
    arena = scene()
    for name, n in POSES.items():
        assert len(arena.poses(name, 1 if name == "thing" else 0)) == n
    assert [len(arena.poses("thing", v)) for v in range(3)] == [3, 5, 1]
    assert (arena.poses("brick")[0].quat == (1, 0, 0, 0)).all()
    np.testing.assert_allclose(arena.poses("wedge")[0].quat, (1, 0, 0, 0), atol=1e-6)
    nominal = arena.nominal_params()
    assert {name: float(nominal.terms[f"{name}.pose"][0]) for name in POSES} == dict.fromkeys(POSES, 0.0)


@pytest.mark.xslow
@pytest.mark.slow
def test_lie_as_placed():
    """In C of each world: every object touches its table with its lowest corner, within the edges, apart from all others."""
    arena, (keys, params) = scene(), drawn()
    assert jax.vmap(arena.valid)(params).all()
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    assert placed.valid.all()
    heights = np.asarray(jax.vmap(arena.rest_heights)(params))
    np.testing.assert_allclose(heights, placed.qpos[:, :, 2], atol=1e-6)
    laid = jax.tree.map(np.asarray, jax.vmap(lambda p: placement.lies(arena.layout.places, p))(params))
    seen = set()
    for w in range(0, 48, 3):
        p = take(params, w)
        model, c = arena.c_world(p, key=keys[w])
        assert min([contact.dist for contact in c.contact], default=0.0) > -1e-5
        top, yaw = p.table_offsets[0], p.table_rots[0]
        for k, obj in enumerate(arena.objects):
            points = points_of(model, c, model.body(obj.name).id) - top
            assert points[:, 2].min() == pytest.approx(0, abs=1e-5), obj.name
            assert points[:, 2].max() == pytest.approx(laid.full_size[w, k, 2], abs=1e-5), obj.name
            cos, sin = np.cos(yaw), np.sin(yaw)
            assert (np.abs(points[:, :2] @ [[cos, -sin], [sin, cos]]) < 0.5 + 1e-5).all()
            turn, back = np.zeros(4), np.asarray(laid.tilt[w, k]) * np.array([1.0, -1, -1, -1])
            mujoco.mju_mulQuat(turn, np.array(placed.qpos[w, k, 3:], float), back)
            own = 2 * np.arctan2(turn[3], turn[0])  # its yaw
            cos, sin = np.cos(own), np.sin(own)
            extents = np.ptp(points[:, :2] @ [[cos, -sin], [sin, cos]], axis=0)
            np.testing.assert_allclose(extents, laid.full_size[w, k, :2], atol=1e-5, err_msg=obj.name)
            whole = 2 * laid.half[w, k] + 2 * laid.radius[w, k]
            np.testing.assert_allclose(extents, whole, atol=1e-5, err_msg=obj.name)
            seen |= {(obj.name, p.terms[f"{obj.name}.pose"][0])} if obj.name in POSES else set()
    assert len(seen) >= 20


TURNED = 2 * 1e-3 / 0.03
"""Contacts give way by less than a millimetre, on either side of the shortest side of all objects [rad]."""


@pytest.mark.slow
def test_stay_where_they_lie():
    """After a second in C nothing has moved by more than contacts give way; what is round may roll, with its axis level."""
    arena, (keys, _) = scene(), drawn()
    nominal = arena.nominal_params()
    for i in range(8):
        numbers = {f"{name}.pose": np.full(1, min(i, n - 1), float) for name, n in POSES.items()}
        p = nominal._replace(terms={**nominal.terms, **numbers})
        variant = int(i >= 3)
        p = arena.with_variants(
            p._replace(terms={**p.terms, "thing.pose": np.full(1, min(i, (2, 4)[variant]))}), thing=variant
        )
        p = jax.tree.map(np.asarray, p)
        assert arena.problems(p) == []
        model, c = arena.c_world(p, key=keys[i])
        bodies = [model.body(obj.name).id for obj in arena.objects]
        before, axes = c.xpos[bodies].copy(), c.xmat[bodies].reshape(-1, 3, 3).copy()
        for _ in range(500):
            mujoco.mj_step(model, c)
        after = c.xmat[bodies].reshape(-1, 3, 3)
        for k, obj in enumerate(arena.objects):
            rolls = obj.name == "rod" or (obj.name == "can" and i >= 2) or (obj.name == "thing" and i == 2)
            assert abs(c.xpos[bodies][k, 2] - before[k, 2]) < 1e-3, obj.name
            if rolls:
                own = 0 if obj.name == "rod" else 2  # along its length
                assert abs(after[k, 2, own] - axes[k, 2, own]) < TURNED, obj.name
            else:
                assert np.linalg.norm(c.xpos[bodies][k] - before[k]) < 1e-3, obj.name
                assert np.arccos(min(1.0, (np.trace(after[k].T @ axes[k]) - 1) / 2)) < TURNED, obj.name


@pytest.mark.slow_on("warp")
def test_worlds_are_compiled(impl):
    """Each field of worlds in all poses is that of the recompiled model."""
    arena = scene(cylinders=False)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    write = jax.jit(lambda p: arena.apply(template, p))
    numbers = [
        name for name in (*nominal._fields, *arena.quantities) if not name.endswith(("active", "terms", "variant"))
    ]
    for i, far in ((1, 0.3), (2, -0.2), (5, 0.1)):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        quantities = [name for name in arena.quantities if name.endswith("pose")]
        lying = {name: np.full(1, min(i, POSES[name.removesuffix(".pose")] - 1), float) for name in quantities}
        params = params._replace(terms={**params.terms, **lying})
        assert oracle.from_compiled(write(params), arena.compile(params)) <= oracle.STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.slow
def test_poses_in_the_model():
    """Of cylinders and variants, too: where everything starts is as in the recompiled model."""
    arena, (_, params) = scene(), drawn()
    template = arena.put_model("warp")
    models = jax.jit(jax.vmap(lambda p: arena.apply(template, p)))(params)
    for w in range(0, 48, 8):
        compiled = arena.compile(take(params, w))
        np.testing.assert_allclose(models.qpos0[w], compiled.qpos0, atol=2e-6)
        bodies = [arena.mj_model.body(compiled.body(b).name).id for b in range(compiled.nbody)]
        for name in ("body_pos", "body_quat", "body_ipos", "body_inertia"):
            want = getattr(compiled, name)
            np.testing.assert_allclose(np.asarray(getattr(models, name)[w])[bodies], want, atol=2e-6)


def test_drawn_as_likely_as_after_a_toss():
    """At the size that a box has in each world, and of the variant that is there; a given `p` counts instead, of what there is."""
    arena = scene()
    keys, sizes = mja.world_keys(1, range(4000)), np.array(arena.nominal_params().object_full_sizes)
    sizes[0] = sizes[0, ::-1]
    flat = mja.ArenaRanges(
        object_full_sizes=mja.Fixed(sizes),
        terms={
            "brick.pose": mja.Choice(list(range(6))),
            "can.pose": mja.Choice([0, 2], p=[0.25, 0.75]),
            "thing.pose": mja.Choice(list(range(5))),
            "thing.variant": mja.Choice([0, 1, 2]),
        },
    )
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, flat)))(keys)
    brick = np.bincount(np.asarray(params.terms["brick.pose"][:, 0], int), minlength=6) / 4000
    share = np.array([pose.share for pose in arena.poses("brick")])[[2, 3, 0, 1, 4, 5]]  # x and z have changed places
    np.testing.assert_allclose(brick, share, atol=0.03)
    assert (params.terms["can.pose"] == 2).mean() == pytest.approx(0.75, abs=0.03)
    for v in range(3):
        chosen = np.asarray(params.terms["thing.pose"][:, 0])[np.asarray(params.terms["thing.variant"][:, 0]) == v]
        share = [pose.share for pose in arena.poses("thing", v)]
        np.testing.assert_allclose(np.bincount(chosen.astype(int)) / len(chosen), share, atol=0.05)
    assert jax.vmap(arena.valid)(params).all()


def test_coded():
    """Poses have their places in the unit cube, and the probability that they are drawn with."""
    arena, (_, params) = scene(), drawn()
    one = jax.tree.map(lambda x: x[5], params)
    again = arena.decode(arena.encode(one, RANGES), RANGES)
    for name in RANGES.terms:
        assert (again.terms[name] == one.terms[name]).all()
    alone = mja.ArenaRanges(terms={"can.pose": mja.Choice([0, 1, 2])})
    nominal = arena.nominal_params()
    for i, pose in enumerate(arena.poses("can")):
        lying = nominal._replace(terms={**nominal.terms, "can.pose": np.full(1, float(i))})
        assert arena.log_prob(lying, alone) == pytest.approx(np.log(pose.share), abs=1e-4)


def test_shown_saved_and_merged(tmp_path):
    arena, (_, params) = scene(), drawn()
    own = mja.TableArena(objects=[OBJECTS[0], OBJECTS[3]])
    ranges = mja.ArenaRanges(terms={"wedge.pose": mja.Choice([0, 3])})
    mja.save(tmp_path / "scene.yaml", own, ranges)
    again, read = mja.load(tmp_path / "scene.yaml")
    assert again.record == own.record
    assert read == ranges
    assert "can.pose" in str(arena.describe(jax.tree.map(lambda x: x[3], params)))
    assert any(r.quantity == "can.pose" and r.max == 2 for r in arena.describe(params).varying)
    both = mja.TableArena((1.0, 1.0, 0.05)).merge(own, prefix="b_", pos=(2, 0, 0))
    assert [pose.share for pose in both.poses("b_wedge")] == [pose.share for pose in own.poses("wedge")]
    p = both.nominal_params()
    flat = p._replace(terms={**p.terms, "b_brick.pose": np.full(1, 2.0)})
    assert both.rest_heights(flat)[0] - both.rest_heights(p)[0] == pytest.approx((0.12 - 0.03) / 2, abs=1e-6)


def test_too_tall_and_too_large():
    """A pole fits below a board, and a plank on one, in some of their poses only."""
    arena = mja.TableArena()
    arena.add_part(mja.furniture.Shelf("rack", pos=(1.5, 0, 0), size=(0.3, 0.6), heights=(0.2, 0.5, 0.8)))
    arena.add_object(mja.Object("pole", full_size=(0.05, 0.45, 0.05), on="rack_board0", pose="resting"))
    arena.add_object(mja.Object("plank", full_size=(0.2, 0.05, 0.9), pose="resting", on="rack_board2"))
    nominal = arena.nominal_params()
    key = mja.world_keys(0, [0])[0]
    assert arena.place(nominal, key).valid.all()
    standing = nominal._replace(terms={**nominal.terms, "pole.pose": np.full(1, 4.0)})
    assert arena.place(standing, key).valid.tolist() == [False, True]
    assert arena.problems(nominal) == []
    lying = nominal._replace(terms={**nominal.terms, "plank.pose": np.full(1, 2.0)})
    assert arena.problems(lying) == [
        "Object 'plank' is 0.9 x 0.05 m, larger than 'rack_board2', which is 0.28 x 0.56 m."
    ]
    assert not arena.valid(lying)


WRONG = {
    "pose": (mja.Object("a", pose="lying"), "Object 'a': `pose` must be 'upright' or 'resting', got 'lying'."),
    "a variant's": (
        mja.Object("a", variants=[mja.Object("b", pose="resting")]),
        (
            "Object 'a': `variants[0].pose` is the same for all variants, got 'resting': give it to the object that has "
            "the variants."
        ),
    ),
    "joints": (
        mja.Object("a", "mjcf", file=WEDGE.parent / "drawer.xml", pose="resting"),
        "Object 'a': `pose` needs a rigid body, but its file has 1 joints: leave out `pose`.",
    ),
    "round": (
        mja.Object(
            "a", "mjcf", file=spec('<mujoco><worldbody><geom name="g" size=".1"/></worldbody></mujoco>'), pose="resting"
        ),
        (
            "Object 'a': its sphere geom 'a_g' reaches out of the hull of its boxes and meshes, so its resting poses "
            "cannot be computed: use a mesh instead, or leave out `pose`."
        ),
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    obj, says = WRONG[case]
    with pytest.raises(ValueError, match="pose") as raised:
        mja.TableArena(objects=[obj])
    assert str(raised.value) == says


def test_wrong_numbers():
    arena = scene()
    nominal = arena.nominal_params()
    ball = arena.with_variants(nominal, thing="ball")
    ball = ball._replace(terms={**ball.terms, "thing.pose": np.full(1, 2.0)})
    assert arena.problems(ball) == [
        "`terms.thing.pose` of object 'thing' must be below 1, as variant 'ball' has 1 pose, got 2.0."
    ]
    assert not arena.valid(ball)
    half = nominal._replace(terms={**nominal.terms, "can.pose": np.full(1, 0.5)})
    assert arena.problems(half) == [
        "`terms.can.pose` of object 'can' must be finite and the number of one of its poses, from 0 to 2, got 0.5."
    ]
    with pytest.raises(ValueError, match=r"can reach 3.0: it must stay between 0 and 2"):
        arena.check_ranges(mja.ArenaRanges(terms={"can.pose": mja.Choice([0, 3])}))
    with pytest.raises(ValueError, match=r"`name`: no object 'plain' has `pose=\"resting\"`; these have: 'brick'"):
        arena.poses("plain")
    with pytest.raises(ValueError, match="`variant` must be"):
        arena.poses("thing", 3)
    scene_xml = (
        '<mujoco><worldbody><body name="cup" pos="0 0 1"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(
        ValueError, match="`pose` must be 'upright', as a body of the scene keeps the pose it has there"
    ):
        mja.Arena.from_xml(scene_xml, objects=[mja.Object("cup", "scene", pose="resting")])
