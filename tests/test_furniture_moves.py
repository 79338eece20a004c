"""Drawers and doors: where they are, what they weigh, where they start, and how they move, as the compiled world's do."""

import dataclasses

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest
import worlds
from test_furniture import boxes, furnished

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture import layouts
from mjx_arenas.record.elsewhere import elsewhere

U = mja.Uniform
PARTS = (furniture.Drawers("drawers", pos=(1.5, 0, 0)), furniture.Cupboard("cupboard", pos=(1.5, 1.2, 0.9)))
RANGES = mja.ArenaRanges(
    terms={
        "drawers.size": U([0.3, 0.4], [0.6, 0.7]),
        "drawers.heights": U(0.1, 0.3),
        "drawers.openings": U(0.0, 0.15),
        "drawers.damping": U(2.0, 8.0),
        "drawers.frictionloss": U(0.3, 1.5),
        "drawers.thickness": U(0.01, 0.02),
        "cupboard.size": U(0.8, 1.2, relative="scale"),
        "cupboard.hinge_left": mja.Bernoulli(0.5),
        "cupboard.opening": U(0.1, 1.2),
        "cupboard.damping": U(0.2, 1.0),
    }
)


@pytest.fixture(scope="module")
def arena():
    return furnished(*PARTS)


def test_drawers():
    """Fronts are as high as they say, above each other, and clear of the carcass and of each other by the gap, shut and pulled out."""
    part = furniture.Drawers("d")
    numbers = {"size": (0.5, 0.6), "heights": (0.3, 0.2, 0.1), "thickness": 0.02}
    found = boxes(part, **numbers)
    for i, height in enumerate(numbers["heights"]):
        front = found[f"drawer{i}_front"]
        assert np.ptp(front[:, 2]) == pytest.approx(height)
        assert front[0, 0] == pytest.approx(-0.25)
        inside = [found[f"drawer{i}_{name}"] for name in ("bottom", "back", "right", "left")]
        assert max(box[1, 2] for box in inside) - front[0, 2] == pytest.approx(0.7 * height)
    joints = part.joints({**part.nominal, **{name: np.asarray(x) for name, x in numbers.items()}})
    assert [float(joint.range[1]) for joint in joints] == pytest.approx([0.8 * 0.46] * 3)
    pieces = ["drawer0", "drawer1", "drawer2", ""]
    of = {name: next(piece for piece in pieces if name.startswith(piece)) for name in found}
    for out in (0.0, float(joints[0].range[1])):
        for one in found:
            for other in found:
                if of[one] < of[other]:
                    a, b = (found[name] - np.array([out, 0, 0]) * (of[name] == "drawer1") for name in (one, other))
                    gap = np.maximum(a[0] - b[1], b[0] - a[1]).max()
                    assert gap > 0.0039, (one, other)


@pytest.mark.parametrize("left", [True, False])
def test_cupboard(left):
    """The door covers the front; its hinge is at its edge, and it opens to the front without touching the carcass."""
    part = furniture.Cupboard("c", size=(0.4, 0.6, 0.7), hinge_left=left)
    model = furnished(part).mj_model
    data = mujoco.MjData(model)
    for angle in (0.0, 0.5, 1.5):
        data.joint("c_door").qpos = angle
        mujoco.mj_forward(model, data)
        touching = {tuple(sorted(model.geom(g).name for g in contact.geom)) for contact in data.contact}
        assert not {pair for pair in touching if any(name.startswith("c_") for name in pair)}
        door = data.geom("c_door")
        hinge = np.array([-0.22, 0.3 if left else -0.3])
        assert np.hypot(*(door.xpos[:2] - hinge)) == pytest.approx(np.hypot(0.3, 0.009))
        if angle:
            assert door.xpos[0] < -0.25
    with_hinge = np.sign(data.geom("c_door").xpos[1])  # open, the door is at its hinge's side
    assert with_hinge == (1 if left else -1)


@pytest.mark.slow
def test_worlds_are_compiled(arena, impl):
    """All numbers others than nominal, masses and inertias of drawers and doors with them: each field as in the recompiled model."""
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    template = arena.put_model(impl)
    numbers = [name for name in arena.quantities if "opening" not in name and not name.endswith("active")]
    bodies = [arena.mj_model.body(name).id for name in ("drawers_drawer1", "cupboard_door")]
    for far in (1.0, -0.5):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        got, compiled = arena.apply(template, params), arena.compile(params)
        assert oracle.from_compiled(got, compiled) <= oracle.STRUCTURE_MAY_DIFFER.keys()
        assert (np.abs(compiled.body_mass[bodies] / arena.mj_model.body_mass[bodies] - 1) > 0.003).all()


def drawn(arena, impl, n=3):
    keys = mja.world_keys(1, range(n))
    batch = arena.randomize(arena.put_model(impl), keys, RANGES)
    return batch, mja.make_data(batch)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_start(arena, impl):
    """Drawers and doors start where each world has them, in C, too; what is beyond their ranges is flagged."""
    batch, data = drawn(arena, impl)
    assert batch.valid.all()
    for w in range(3):
        params = jax.tree.map(lambda x, w=w: np.asarray(x)[w], batch.params)
        c = arena.c_world(params)[1]
        for name, want in (("drawers_drawer", "drawers.openings"), ("cupboard_door", "cupboard.opening")):
            for i, value in enumerate(np.asarray(params.terms[want])):
                joint = f"{name}{i}" if name.startswith("drawers") else name
                adr = arena.mj_model.joint(joint).qposadr[0]
                assert data.qpos[w, adr] == pytest.approx(value, abs=1e-6)
                assert c.joint(joint).qpos[0] == pytest.approx(value, abs=1e-6)
    nominal = arena.nominal_params()
    for name, value, says in (
        ("drawers.openings", [0.0, 0.5, 0.0], " must be from 0 to 0.8 of the depth"),
        ("cupboard.opening", [2.5], " of part 'cupboard_door' must be between 0 and 1.9 [rad]"),
    ):
        params = nominal._replace(terms={**nominal.terms, name: jnp.array(value)})
        assert not arena.valid(params)
        (problem,) = arena.problems(params)
        assert problem.startswith(f"`terms.{name}`{says}")


@pytest.mark.slow
def test_pulled_and_pushed(arena, impl):
    """Under one force drawers and doors are, after these steps, where the compiled world's are in C."""
    batch, data = drawn(arena, impl)
    assert_as_in_c(arena, batch, data, FORCES, {"jax": 70, "warp": 100}[impl])


FORCES = {"drawers_drawer0": 6.0, "drawers_drawer1": 4.0, "drawers_drawer2": 3.0, "cupboard_door": -1.2}


def assert_as_in_c(arena, batch, data, forces, steps):
    """What these forces, by the names of joints, have moved after some steps is where it is in C."""
    model = arena.mj_model
    names, force = list(forces), np.array(list(forces.values()))
    dofs = np.array([model.joint(name).dofadr[0] for name in names])
    data = data.replace(qfrc_applied=data.qfrc_applied.at[:, dofs].set(force))
    step = jax.jit(lambda data: jax.lax.scan(lambda d, _: (mja.step(batch, d), None), data, length=steps)[0])
    start, end = np.asarray(data.qpos, float), np.asarray(step(data).qpos, float)
    for w in range(len(start)):
        params = jax.tree.map(lambda x, w=w: np.asarray(x)[w], batch.params)
        compiled, c = arena.c_world(params)
        own = np.array([compiled.joint(name).dofadr[0] for name in names])
        c.qfrc_applied[own] = force
        mujoco.mj_step(compiled, c, steps)
        for name in names:
            at = model.joint(name).qposadr[0]
            moved = c.joint(name).qpos[0] - start[w, at]
            assert abs(moved) > 0.003
            assert end[w, at] - start[w, at] == pytest.approx(moved, rel=3e-3, abs=1e-5)


@pytest.mark.xslow
def test_eight_are_pulled_and_pushed():
    """Each of eight units has numbers of its own, and moves as in C, on Warp."""
    n = 8
    parts = [dataclasses.replace(part, name=f"{part.name}{i}") for part in PARTS for i in range(n)]
    arena = furnished(*layouts.grid(parts, n, (3.0, 3.0), pos=(3, 0, 0)))
    terms, forces = {}, {}
    for i in range(n):
        for name, dist in RANGES.terms.items():
            terms[name.replace(".", f"{i}.")] = dist
        for name, force in FORCES.items():
            forces[name.replace("_", f"{i}_")] = force * (1 - 0.05 * i)
    keys = mja.world_keys(1, [0])
    batch = arena.randomize(arena.put_model("warp"), keys, mja.ArenaRanges(terms=terms))
    openings = np.concatenate([batch.params.terms[f"drawers{i}.openings"] for i in range(n)], axis=1)
    assert batch.valid.all()
    assert len(np.unique(openings)) == openings.size
    assert_as_in_c(arena, batch, mja.make_data(batch), forces, 100)


WRONG = {
    "openings": (
        lambda: furniture.Drawers("d", openings=(0.0, 0.0, 0.9)),
        "Part 'd': `openings` must be from 0 to 0.8 of the depth inside [m], got (0.0, 0.0, 0.9).",
    ),
    "too few openings": (
        lambda: furniture.Drawers("d", openings=(0.0,)),
        "Part 'd': `openings` must be 3 numbers, one for each drawer",
    ),
    "no friction": (lambda: furniture.Drawers("d", frictionloss=0), "Part 'd': `frictionloss` must be > 0"),
    "thick": (
        lambda: furniture.Drawers("d", thickness=0.1),
        "Part 'd': `thickness` must be small against depth, width and heights [m]",
    ),
    "hinge": (
        lambda: furniture.Cupboard("c", hinge_left="left"),
        "Part 'c': `hinge_left` must be true or false, got 'left'.",
    ),
    "opening": (
        lambda: furniture.Cupboard("c", opening=-1),
        "Part 'c': `opening` must be between 0 and 1.9 [rad], got -1.0.",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_parts(case):
    made, says = WRONG[case]
    with pytest.raises(ValueError, match=r"[Pp]art") as raised:
        mja.TableArena().add_part(made())
    assert says in str(raised.value)


@pytest.fixture(scope="module")
def laden():
    """Things on and in drawers and a cupboard, and on what stands there."""
    arena = furnished(*PARTS, furniture.Bin("tray", on="drawers_top", inner_size=(0.4, 0.4, 0.1)))
    arena.add_part(furniture.Drawers("small", on="tray_bottom", pos=(0, -0.08, 0), size=(0.2, 0.2), heights=(0.1,)))
    for name, on in (("cup", "tray_bottom"), ("sock", "drawers_drawer2_bottom"), ("plate", "cupboard_bottom")):
        arena.add_object(mja.Object(name, full_size=0.06, on=on, pos=(0, 0.12) if name == "cup" else None))
    arena.add_object(mja.Object("pin", full_size=0.02, on="cup"))
    return arena


GOES = {
    "drawers": {"drawers", "tray", "small", "cup", "pin", "sock"},
    "cupboard": {"cupboard", "plate"},
    "small": {"small"},
}


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges` leaves object")
@pytest.mark.parametrize("gone", [("drawers",), ("cupboard", "small")])
def test_what_moves_comes_and_goes(laden, impl, gone):
    """With all that stands on and in it; what is left is the world compiled without, field by field."""
    ranges = mja.ArenaRanges(terms=RANGES.terms | {f"{name}.active": mja.Fixed(False) for name in gone})
    params = jax.tree.map(np.asarray, laden.sample_params(mja.world_keys(2, [0])[0], ranges))
    assert laden.valid(params)
    compiled = laden.compile(params)
    names, every = (
        {model.body(b).name for b in range(1, model.nbody) if model.body(b).parentid[0] == 0}
        for model in (compiled, laden.mj_model)
    )
    assert names == every - set().union(*(GOES[name] for name in gone))
    got = laden.apply(laden.put_model(impl), params)
    compared, off = oracle.of_what_is_left(got, laden.mj_model, compiled)
    assert len(compared) > 40
    assert not off
    for name in every - names:
        at = worlds.leaves(got)["body_pos"][laden.mj_model.body(name).id]
        assert at[2] > 500 or laden.mj_model.body(name).dofnum[0] == 6
    assert (np.asarray(params.object_active) == [o.name in names for o in laden.objects]).all()
    written = laden.to_xml(params)
    assert [f'name="{name}"' in written for name in every] == [name in names for name in every]
    assert laden.c_world(params)[0].njnt == compiled.njnt


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:`ranges` leaves object")
@pytest.mark.slow_on("warp")
def test_single_drawers_come_and_go(laden, impl):
    """With what lies in them; the others, and the carcass, are those of the world compiled without."""
    ranges = mja.ArenaRanges(terms=RANGES.terms | {"drawers.pieces_active": mja.Fixed([True, False, False])})
    params = jax.tree.map(np.asarray, laden.sample_params(mja.world_keys(2, [0])[0], ranges))
    assert laden.valid(params)
    compiled = laden.compile(params)
    bodies, every = ({model.body(b).name for b in range(model.nbody)} for model in (compiled, laden.mj_model))
    assert every - bodies == {"drawers_drawer1", "drawers_drawer2", "sock"}
    assert compiled.njnt == laden.mj_model.njnt - 3
    compared, off = oracle.of_what_is_left(laden.apply(laden.put_model(impl), params), laden.mj_model, compiled)
    assert len(compared) > 40
    assert off == set()
    counts = mja.ArenaRanges(terms={"drawers.pieces_active": mja.Count(1, 3, first=True)})
    keys = mja.world_keys(2, range(200))
    drawn = jax.jit(jax.vmap(lambda k: laden.sample_params(k, counts)))(keys)
    there = np.asarray(drawn.terms["drawers.pieces_active"])
    assert set(there.sum(1)) == {1, 2, 3}
    assert (there[:, :-1] >= there[:, 1:]).all()
    np.testing.assert_array_equal(drawn.object_active[:, [o.name for o in laden.objects].index("sock")], there[:, 2])


@pytest.mark.xslow
@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_steps_without_it(laden, impl):
    """Worlds in which what moves is absent do as in C without it; what nothing holds falls 8 mm in the fewer steps of JAX."""
    steps = {"jax": 20, "warp": 50}[impl]
    terms = RANGES.terms | {f"{name}.active": mja.Bernoulli(0.5) for name in GOES}
    terms |= {"drawers.pieces_active": mja.Bernoulli(0.5)}
    keys = mja.world_keys(2, range(4))
    batch = laden.randomize(laden.put_model(impl), keys, mja.ArenaRanges(terms=terms))
    seen = np.stack([np.asarray(batch.params.terms[f"{name}.active"])[:, 0] for name in GOES])
    assert (seen.any(1) & ~seen.all(1)).all()
    data = mja.rollout(batch, mja.make_data(batch, keys), steps)
    for w in range(4):
        params = jax.tree.map(lambda x, w=w: np.asarray(x)[w], batch.params)
        compiled, c = laden.c_world(params, key=keys[w])
        mujoco.mj_step(compiled, c, steps)
        for b in range(1, compiled.nbody):
            name = compiled.body(b).name
            got = data.xpos[w, laden.mj_model.body(name).id]
            np.testing.assert_allclose(got, c.body(name).xpos, atol=5e-4, err_msg=name)
