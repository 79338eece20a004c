"""Where objects may be placed: a region of their surface, off its edges, in reach of a robot, wherever these are in each world."""

import functools
import warnings
from typing import Any

import jax
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr, furniture

U = mja.Uniform
ARM = '<mujoco><worldbody><body name="base"><geom size=".03" pos="0 0 .1"/></body></worldbody></mujoco>'
REGION = mja.Place(region=((-1, 0.2), (0.5, 1)))
REACH = mja.Place(near="arm_base", distance=(0.2, 0.35))


@functools.cache
def manned():
    """An arena with a robot on its table, and a bench with another; the places of objects in the frames of what they are about."""
    arena = mja.TableArena(
        (1, 1, 0.05), objects=[mja.Object("left", full_size=0.06, place=REGION), mja.Object("near", place=REACH)]
    )
    arena.add_part(furniture.Counter("bench", pos=(2, 0, 0), widths=(0.8, 0.8), stays=True))
    arena.attach(ARM, "arm_", pos=(-0.2, 0.1, 0), on=0)
    arena.attach(ARM, "far_", pos=(0.1, 0, 0), on="bench_top1")
    arena.add_object(mja.Object("inner", full_size=0.1, on="bench_top0", place=mja.Place(margin=0.12)))
    arena.add_object(mja.Object("far", on="bench_top0", place=mja.Place(near="far_base", distance=(0.0, 0.6))))
    arena.add_object(mja.Object("fixed", on="bench_top1", place=mja.Place(near=(1.7, 1.2), distance=(0.0, 0.4))))
    return arena


@pytest.mark.slow
def test_in_place():
    """In C of each world: where each object is, and what it should be near."""
    arena = manned()
    terms = {"bench.widths": U(0.6, 0.8), "bench.rot": U(-0.2, 0.2)}
    ranges = mja.ArenaRanges(table_offsets=U(-0.1, 0.1, relative="add"), table_rots=U(-3.0, 3.0), terms=terms)
    keys = mja.world_keys(0, range(48))
    params = jax.vmap(lambda k: arena.sample_params(k, ranges))(keys)
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    assert placed.valid.all()
    spread = []
    for w in range(0, 48, 3):
        p = jax.tree.map(lambda x, w=w: np.asarray(x)[w], params)
        model, c = arena.c_world(p, key=keys[w])

        def local(body, geom, model=model, c=c):
            axes = c.geom(geom).xmat.reshape(3, 3)
            return (axes.T @ (c.body(body).xpos - c.geom(geom).xpos))[:2] / model.geom(geom).size[:2], model.geom(
                geom
            ).size[:2]

        left, half = local("left", "table_collision")
        assert (left - 0.03 / half >= [-1, 0.2] - 1e-5 * np.ones(2)).all()
        assert (left + 0.03 / half <= [0.5, 1] + 1e-5 * np.ones(2)).all()
        inner, half = local("inner", "bench_top0")
        assert (np.abs(inner) * half <= half - 0.12 - 0.05 + 1e-5).all()
        away = {
            of: np.linalg.norm((c.body(of).xpos - c.body(base).xpos)[:2])
            for of, base in (("near", "arm_base"), ("far", "far_base"))
        }
        assert 0.2 - 1e-5 <= away["near"] <= 0.35 + 1e-5
        assert away["far"] <= 0.6 + 1e-5
        assert np.linalg.norm(c.body("fixed").xpos[:2] - (1.7, 1.2)) <= 0.4 + 1e-5
        spread.append([left[1], away["near"], away["far"]])
    assert (np.ptp(spread, axis=0) > [0.4, 0.08, 0.15]).all()  # all over


TOWER = """<mujoco><worldbody><body name="base"><geom size=".02" pos="0 0 .02"/><body name="tower" pos=".15 0 .1" euler="0 20 0">
  <geom size=".02"/><body name="lamp" pos="0 .05 .05"/></body></body></worldbody></mujoco>"""


@pytest.mark.slow
def test_near_what_terms_move():
    """Bodies that terms move and turn, or on which others hang, on a table, a part and the floor; C says where they are."""
    near = {
        "on_table": (0, "a_lamp"),
        "on_part": ("bench_top0", "b_tower"),
        "on_floor": (0, "c_base"),
        "still": (0, "d_lamp"),
    }
    arena = mja.TableArena((1.2, 1.2, 0.05))
    arena.add_part(furniture.Counter("bench", pos=(2, 0, 0), widths=(0.9, 0.9), stays=True))
    for prefix, on, pos in (
        ("a_", 0, (-0.2, 0.1, 0)),
        ("b_", "bench_top0", (-0.15, 0.1, 0)),
        ("c_", None, (0.8, 0, 0)),
        ("d_", 0, (0.2, -0.1, 0)),
    ):
        arena.attach(TOWER, prefix, pos=pos, on=on)
    for name, (on, body) in near.items():
        place = mja.Place(near=body, distance=(0.16, 0.45))
        arena.add_object(mja.Object(name, full_size=0.04, on=on, place=place))
    arena.vary(
        shifts=dr.Term("body.pos", ["a_base", "b_base", "c_base"]),
        turns=dr.Term("body.rpy", ["a_base", "b_base", "a_tower", "c_base"]),
    )
    terms = {
        "shifts": U([-0.1, -0.1, 0], [0.1, 0.1, 0.05], relative="add"),
        "turns": U([-0.2, -0.2, -2], [0.2, 0.2, 2]),
    }
    terms |= {"bench.rot": U(-0.3, 0.3)}
    ranges = mja.ArenaRanges(table_offsets=U(-0.1, 0.1, relative="add"), table_rots=U(-3.0, 3.0), terms=terms)
    keys = mja.world_keys(0, range(24))
    params = jax.vmap(lambda k: arena.sample_params(k, ranges))(keys)
    placed = jax.jit(jax.vmap(arena.place))(params, keys)
    away, nominal = [], []
    for w in range(24):
        model, c = arena.c_world(jax.tree.map(lambda x, w=w: np.asarray(x)[w], params), key=keys[w])
        away.append([np.linalg.norm((c.body(name).xpos - c.body(body).xpos)[:2]) for name, (_, body) in near.items()])
        nominal.append([model.body(f"{p}_base").pos for p in "abc"])
    away, found = np.array(away), np.asarray(placed.valid)
    assert (found.mean(0) > 0.7).all()
    assert (away[found] > 0.16 - 1e-5).all()
    assert (away[found] < 0.45 + 1e-5).all()
    assert all(np.ptp(away[found[:, k], k]) > 0.15 for k in range(len(near)))  # all over the ring
    assert (np.ptp(nominal, axis=0)[..., :2] > 0.1).all()


def test_out_of_reach():
    """What finds no place in reach is flagged."""
    arena = manned()
    nominal = arena.nominal_params()
    far = nominal._replace(terms={**nominal.terms, "bench.pos": nominal.terms["bench.pos"] + 3})
    placed = jax.jit(arena.place)(far, mja.world_keys(0, [0])[0])
    assert [o.name for o, found in zip(arena.objects, placed.valid, strict=True) if not found] == ["fixed"]


PARTS = (
    furniture.Shelf("rack", pos=(0.9, 0, 0), near="arm_base", distance=(0.5, 0.9)),
    furniture.Drawers("unit", pos=(0, 2, 0), near=(0, 0), distance=(1.6, 3)),
    furniture.Zone("spot", pos=(0, -1.5, 0), near="arm_base", distance=(0, 1.2)),
)


@pytest.mark.slow
@pytest.mark.parametrize("moves", [False, pytest.param(True, marks=pytest.mark.xslow)])
def test_parts_in_reach(tmp_path, moves):
    """A world is invalid where the nearest point of a part that is there, by C, is closer or farther; and a sentence says which."""
    arena = mja.TableArena((0.6, 0.6, 0.05))
    arena.attach(ARM, "arm_", pos=(-0.1, 0.05, 0), on=0)
    if moves:
        arena.vary(base=dr.Term("body.pos", "arm_base"))
    for part in PARTS:
        arena.add_part(part)
    assert arena.valid(arena.nominal_params())
    terms = {f"{part.name}.pos": U([-0.3, -0.3, 0], [0.3, 0.3, 0], relative="add") for part in PARTS}
    terms |= {f"{part.name}.rot": U(-3.0, 3.0) for part in PARTS} | {"rack.active": mja.Bernoulli(0.8)}
    terms |= {"base": U([-0.15, -0.15, 0], [0.15, 0.15, 0], relative="add")} if moves else {}
    ranges = mja.ArenaRanges(table_offsets=U(-0.1, 0.1, relative="add"), table_rots=U(-3.0, 3.0), terms=terms)
    keys, seen = mja.world_keys(0, range(20)), set()
    params = jax.vmap(lambda k: arena.sample_params(k, ranges))(keys)
    valid = np.asarray(jax.jit(jax.vmap(arena.valid))(params))
    for w in range(20):
        p = jax.tree.map(lambda x, w=w: np.asarray(x)[w], params)
        model, c = arena.c_world(p)
        told, wrong = arena.problems(p), {}
        for part in PARTS:
            base = np.zeros(3) if part.name == "unit" else c.body("arm_base").xpos
            boxes = [
                (c.geom(g).xpos, c.geom(g).xmat.reshape(3, 3), model.geom(g).size)
                for g in range(model.ngeom)
                if model.geom(g).name.startswith(part.name)
            ]
            if part.name == "spot":
                cos, sin = np.cos(p.terms["spot.rot"][0]), np.sin(p.terms["spot.rot"][0])
                boxes = [(p.terms["spot.pos"][0], np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]), (0.5, 0.5, 0))]
            nearest = [np.hypot(*np.maximum(np.abs(turn.T @ (base - at)) - half, 0)[:2]) for at, turn, half in boxes]
            if nearest and not part.distance[0] <= min(nearest) <= part.distance[1]:
                wrong[part.name] = min(nearest)
            seen.add((part.name, part.name in wrong))
        said = [text for text in told if " m away from " in text]
        assert len(said) == bool(wrong)
        for name, away in list(wrong.items())[:1]:
            assert said[0].startswith(
                f"Part {name!r} is {away:.3g} m away from {'(0, 0)' if name == 'unit' else repr('arm_base')}, "
            )
        assert valid[w] == (not told)
    assert len(seen) == 6
    world = int(np.flatnonzero(~valid)[0])
    report = mja.check(arena, ranges, worlds=[world], n_steps=1, engine="c")
    report.save_bundle(tmp_path / "bundle", world)
    assert mja.replay(tmp_path / "bundle").found["invalid_arena"] == report.of(world)["invalid_arena"]


AWAY: dict[str, Any] = {
    "a part": (
        {},
        "Part 'spot' is 1.05 m away from 'arm_base' in the nominal arena, instead of 0 to 0.8 m.",
        1.0,
    ),
    "an object": (
        {"place": mja.Place(near="arm_base", distance=(0.2, 0.25)), "pos": (0.2, 0.05)},
        "Object 'cube' is 0.3 m away from 'arm_base' at its nominal place, instead of 0.2 to 0.25 m: `make_data` with keys draws "
        "places within.",
        1.0,
    ),
    "a table too far": (
        {"place": mja.Place(near=(1, 0), distance=(0, 0.72))},
        "Object 'cube' finds no free place in the nominal arena: on table 0 it is 0.725 to 1.3 m away from (1, 0), instead of 0 to "
        "0.72 m.",
        0.0,
    ),
    "a table too near": (
        {"place": mja.Place(near=(0, 0), distance=(0.4, 5))},
        "Object 'cube' finds no free place in the nominal arena: on table 0 it is 0 to 0.389 m away from (0, 0), instead of 0.4 to "
        "5 m.",
        0.0,
    ),
    "just far enough": ({"place": mja.Place(near=(1, 0), distance=(0, 0.75))}, None, 1.0),
    "just near enough": ({"place": mja.Place(near=(0, 0), distance=(0.36, 5))}, None, 1.0),
    "as far as it may": ({"place": mja.Place(near=(0.04, -0.11), distance=(0, 0.15)), "pos": (0.19, -0.11)}, None, 1.0),
    "on another": ({"place": mja.Place(near=(0, 0), distance=(0, 0.6)), "on": "tray"}, None, 1.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", AWAY)
def test_nominally_out_of_reach(case):
    """One sentence when the arena is compiled, of what is there and not as near as it must be; and what it says of keys is so."""
    given, says, share = AWAY[case]
    tray = mja.Object("tray", full_size=(0.3, 0.3, 0.02))
    arena = mja.TableArena(
        (0.6, 0.6, 0.05), objects=[*([tray] if "on" in given else []), mja.Object("cube", full_size=0.05, **given)]
    )
    arena.attach(ARM, "arm_", pos=(-0.1, 0.05, 0), on=0)
    if case == "a part":
        arena.add_part(furniture.Zone("spot", pos=(0, -1.5, 0), near="arm_base", distance=(0, 0.8)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        nominal = arena.nominal_params()
        assert arena.mj_model.nbody
    assert [str(w.message) for w in caught if "inside each other" not in str(w.message)] == ([says] if says else [])
    found = jax.vmap(arena.place, in_axes=(None, 0))(nominal, mja.world_keys(0, range(20)))
    assert found.valid[:, -1].mean() == share


ROOM = {
    "just": (mja.Place(margin=0.974), {}, None),
    "margin": (mja.Place(margin=0.98), {}, "0.04 x 0.04 m of table 0 for its outline of 0.05 x 0.05 m."),
    "wide": (mja.Place(margin=3.0), {}, "0 x 0 m of table 0 for its outline of 0.05 x 0.05 m."),
    "strip": (
        mja.Place(region=((-1, -1), (1, -0.96))),
        {},
        "2 x 0.04 m of table 0 for its outline of 0.05 x 0.05 m.",
    ),
    "thin": (mja.Place(region=((-1, 0.96), (1, 1))), {"full_size": (0.3, 0.03, 0.05)}, None),
    "turned": (mja.Place(region=((-1, 0.96), (1, 1)), rot=(0.0, 0.0)), {"full_size": (0.3, 0.03, 0.05)}, None),
    "crosswise": (
        mja.Place(region=((-1, 0.88), (1, 0.92)), rot=(1.57, 1.57)),
        {"full_size": (0.3, 0.03, 0.05)},
        "2 x 0.04 m of table 0 for its outline of 0.3 x 0.03 m, turned by its `rot` of 1.57.",
    ),
    "long": (
        mja.Place(rot=(1.57, 1.57)),
        {"full_size": (0.3, 0.03, 0.05), "on": "plank"},
        "0.35 x 0.1 m of object 'plank' for its outline of 0.3 x 0.03 m, turned by its `rot` of 1.57.",
    ),
    "round": (
        mja.Place(margin=0.07),
        {"on": "drum"},
        "a disc of 0.06 m of object 'drum' for its outline of 0.05 x 0.05 m.",
    ),
    "inner": (mja.Place(margin=0.02), {"on": "drum"}, None),
    "gone": (mja.Place(margin=3.0), {"active": False}, None),
}
"""Objects that are nominally there or not, and what is told of those which their place leaves no room."""


@pytest.mark.slow
def test_nominally_without_room():
    """One sentence each when the arena is compiled, of those alone that then find no place with any key."""
    drum = mja.Object("drum", "cylinder", (0.2, 0.2, 0.1))
    objects = [
        mja.Object(name, **{"full_size": 0.05, "place": place, **more}) for name, (place, more, _) in ROOM.items()
    ]
    aside = mja.Place(region=((-1, -0.9), (1, -0.5)))
    plank = mja.Object("plank", full_size=(0.35, 0.1, 0.02), place=aside)
    arena = mja.TableArena((2, 2, 0.05), objects=[drum, plank, *objects])
    with pytest.warns(UserWarning, match="finds no free place") as caught:
        assert arena.mj_model.nbody
    told = {
        name: f"Object {name!r} finds no free place in the nominal arena: its `region` and `margin` leave {says}"
        for name, (*_, says) in ROOM.items()
        if says
    }
    assert [text for w in caught if "no free place in" in (text := str(w.message))] == list(told.values())
    found = jax.vmap(arena.place, in_axes=(None, 0))(arena.nominal_params(), mja.world_keys(0, range(8)))
    assert found.valid.mean(0).tolist() == [float(name not in told) for name in ["drum", "plank", *ROOM]]


@pytest.mark.parametrize("most", [5.0, 1e6])
def test_too_close(most):
    """The least distance holds, however large the other one is."""
    arena = mja.TableArena()
    arena.add_part(furniture.Zone("spot", pos=(2, 0, 0), size=(1, 1), near=(1, 0), distance=(0.6, most)))
    with pytest.warns(UserWarning, match=r"Part 'spot' is 0.5 m away from \(1, 0\) in the nominal arena"):
        assert arena.mj_model.ngeom
    nominal = arena.nominal_params()
    for shift, right in ((0.0, False), (0.09, False), (0.11, True)):
        moved = nominal._replace(
            terms={**nominal.terms, "spot.pos": nominal.terms["spot.pos"] + np.array([shift, 0, 0])}
        )
        assert arena.valid(moved) == right


def test_files(tmp_path):
    arena = mja.TableArena(objects=[mja.Object("left", full_size=0.06, place=REGION), mja.Object("near", place=REACH)])
    arena.add_part(furniture.Zone("spot", pos=(2, 0, 0), near=(1, 0), distance=(0.2, 3)))
    mja.save(tmp_path / "scene.yaml", arena, mja.ArenaRanges())
    again, _ = mja.load(tmp_path / "scene.yaml")
    assert again.objects == arena.objects
    assert again.calls == arena.calls


@pytest.mark.slow
@pytest.mark.parametrize("near", ["arm_base", (-0.2, 0.1)])
def test_merged(near):
    """In a merged arena an object stays near the same body, or the same point of its own floor."""
    reach = mja.Place(near=near, distance=(0.2, 0.25))
    other = mja.TableArena((1, 1, 0.05), objects=[mja.Object("cup", full_size=0.06, place=reach)])
    other.attach(ARM, "arm_", pos=(-0.2, 0.1, 0), on=0)
    arena = mja.TableArena().merge(other, "b_", pos=(3, 0.5, 0), rot=1.0)
    base = np.array([3, 0.5]) + np.array([[np.cos(1), -np.sin(1)], [np.sin(1), np.cos(1)]]) @ (-0.2, 0.1)
    placed = jax.vmap(lambda key: arena.place(arena.nominal_params(), key))(mja.world_keys(0, range(16)))
    assert placed.valid.all()
    away = np.linalg.norm(placed.qpos[:, 0, :2] - base, axis=-1)
    assert (np.abs(away - 0.225) <= 0.025 + 1e-5).all()


@pytest.mark.slow
@pytest.mark.parametrize("rot", [(-0.3, 0.2), (0.4, 0.4), None])
def test_yaws(rot, tmp_path):
    """Relative to the table, or the object, on which it stands, in the MuJoCo model of each world; an arena of a file has the same."""
    objects = [
        mja.Object("tray", full_size=(0.3, 0.25, 0.02), place=mja.Place(rot=rot)),
        mja.Object("book", full_size=(0.1, 0.06, 0.03), on="tray", place=mja.Place(rot=rot)),
    ]
    arena = mja.TableArena((1, 1, 0.05), objects=objects)
    mja.save(tmp_path / "arena.yaml", arena, mja.ArenaRanges(table_rots=U(-3.0, 3.0)))
    arena, ranges = mja.load(tmp_path / "arena.yaml")
    keys = mja.world_keys(0, range(60))
    params = jax.vmap(lambda key: arena.sample_params(key, ranges))(keys)
    placed = jax.vmap(arena.place)(params, keys)
    assert placed.valid.all()
    yaw = 2 * np.arctan2(placed.qpos[..., 6], placed.qpos[..., 3])
    own = np.column_stack([yaw[:, 0] - params.table_rots[:, 0], yaw[:, 1] - yaw[:, 0]])
    own = np.remainder(own + np.pi, 2 * np.pi) - np.pi
    low, high = rot or (-np.pi, np.pi)
    assert ((own >= low - 1e-5) & (own <= high + 1e-5)).all()
    assert (np.ptp(own, axis=0) >= 0.8 * (high - low)).all()
    _, c = arena.c_world(jax.tree.map(lambda x: np.asarray(x)[5], params), key=keys[5])
    between = c.body("table").xmat.reshape(3, 3).T @ c.body("tray").xmat.reshape(3, 3)
    assert np.arctan2(between[1, 0], between[0, 0]) == pytest.approx(own[5, 0], abs=1e-5)


WRONG = {
    "rot in degrees": (
        {"rot": (30, 45)},
        "`place.rot` must be the least and the most yaw, from -6.284 to 6.284 and at most a full turn apart [rad], or None for any, got",
    ),
    "rot that ends before it begins": ({"rot": (0.3, -0.3)}, "`place.rot` must be the least and the most yaw"),
    "one rot": ({"rot": 0.3}, "`place.rot` must be the least and the most yaw"),
    "region": (
        {"region": ((0, 0), (2, 1))},
        "`place.region` must be two corners (least x, least y), (most x, most y), from -1 to 1, got",
    ),
    "an empty region": ({"region": ((0, 0), (0, 1))}, "`place.region` must be two corners"),
    "margin": ({"margin": -0.1}, "`place.margin` must be one number >= 0 [m], got -0.1."),
    "near": ({"near": 3}, "`place.near` must be the name of a body, 2 numbers x, y [m], or None, got 3."),
    "distance": (
        {"near": (0, 0), "distance": (0.5, 0.2)},
        "`place.distance` must be 2 numbers >= 0, the first below the second [m], got",
    ),
    "distance from nothing": ({"distance": (0, 1)}, "`place.near` must be given where there is a `distance`"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case):
    given, says = WRONG[case]
    with pytest.raises(ValueError, match="place") as raised:
        mja.TableArena(objects=[mja.Object("a", place=mja.Place(**given))])
    assert str(raised.value).startswith(f"Object 'a': {says}")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"near": 3}, "Part 'rack': `near` must be the name of a body, 2 numbers x, y [m], or None, got 3."),
        ({"near": (0, 0)}, "Part 'rack': `distance` must be given where there is `near`, got nothing."),
        ({"distance": (0, 1)}, "Part 'rack': `near` must be given where there is a `distance`, got None."),
        (
            {"near": "arm", "distance": (2, 1)},
            "Part 'rack': `distance` must be 2 numbers >= 0, the first below the second [m], got (2.0, 1.0).",
        ),
        (
            {"near": "arm", "distance": (0, 1)},
            "`rack.near` must be the name of a body that no joint moves and that is not mocap, a point x, y [m], or None: "
            "no body is called 'arm'; known are table, rack, rack_board0, rack_board1, rack_board2, rack_board3.",
        ),
    ],
)
def test_wrong_parts(given, says):
    def compiled():
        arena = mja.TableArena()
        arena.add_part(furniture.Shelf("rack", pos=(2, 0, 0), **given))
        return arena.mj_model

    with pytest.raises(ValueError, match=r"part|rack") as raised:
        compiled()
    assert str(raised.value) == says


OF_TASK = "The arm of a task is there once the task has attached it: for an arena without the task, as in commands on a file, give the x "
OF_TASK += "and y of the arm's base."


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("hand", ": no body is called 'hand'; known are table, base."),
        ("arm_base", f": no body is called 'arm_base'. {OF_TASK}"),
        ("bsae", ": no body is called 'bsae': did you mean `base`?"),
        ("targt", ": no body is called 'targt'; known are table, base."),  # the target is none that would do
        *((name, f", got {name!r}.") for name in ("slider", "lamp", "target")),
    ],
)
def test_wrong_bodies(name, says):
    """Bodies that are not there, or move, when the arena is compiled."""
    arena = mja.TableArena(objects=[mja.Object("a", place=mja.Place(near=name, distance=(0, 1)))])
    body = arena.spec.worldbody.add_body(name="slider")
    body.add_joint(name="slide")
    body.add_geom(size=(0.1, 0.1, 0.1), pos=(3, 0, 0))
    body.add_body(name="lamp")
    arena.spec.worldbody.add_body(name="target", mocap=True)
    arena.spec.worldbody.add_body(name="base")
    with pytest.raises(ValueError, match="near") as raised:
        _ = arena.mj_model
    assert str(raised.value) == (
        f"Object 'a': `place.near` must be the name of a body that no joint moves and that is not mocap, a point x, y [m], "
        f"or None{says}"
    )


@pytest.mark.parametrize("near", ["cube", "target"])
def test_near_what_moves_already(near):
    """What is there and moves is refused by the call that names it, which changes nothing; what is not there may still come."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.worldbody.add_body(name="target", mocap=True)
    before = arena.spec.to_xml()
    must = f"must be the name of a body that no joint moves and that is not mocap, a point x, y [m], or None, got {near!r}."
    with pytest.raises(ValueError, match="near") as raised:
        arena.add_part(furniture.Bin("bin", pos=(2, 0, 0), near=near, distance=(0, 5)))
    assert str(raised.value) == f"Part 'bin': `near` {must}"
    with pytest.raises(ValueError, match="near") as raised:
        arena.add_object(mja.Object("cup", place=mja.Place(near=near, distance=(0, 1))))
    assert str(raised.value) == f"Object 'cup': `place.near` {must}"
    assert arena.spec.to_xml() == before
    arena.add_part(furniture.Bin("bin", pos=(2, 0, 0), near="arm_base", distance=(0, 5)))
    arena.attach(ARM, "arm_", pos=(-0.2, 0.1, 0), on=0)
    assert arena.mj_model


def test_not_a_place():
    with pytest.raises(ValueError, match=r"Object 'a': `place` must be an mjx_arenas.Place or None, got 'left'."):
        mja.TableArena(objects=[mja.Object("a", place="left")])
