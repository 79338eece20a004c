"""Walls with holes, ramps and rails collide where each world has them: balls go through holes, are held beside them, and roll down."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture

U = mja.Uniform
PARTS = (
    furniture.Wall("window", pos=(3, 0, 0), window=(1, 0.8)),
    furniture.Wall("door", pos=(3, 6, 0), door=(0.9, 2)),
    furniture.Ramp("ramp", pos=(-4, 0, 0)),
    furniture.Rail("fence", pos=(-4, 6, 0), heights=(0.4, 0.9)),
)
RANGES = mja.ArenaRanges(
    terms={
        **{f"{part.name}.rot": U(-3.0, 3.0) for part in PARTS},
        **{f"{part.name}.pos": U([-0.5, -0.5, 0], [0.5, 0.5, 0], relative="add") for part in PARTS},
        "window.full_size": U([0.05, 2.6, 2.3], [0.2, 3.2, 2.6]),
        "window.window": U([0.4, 0.3], [1.2, 0.9]),
        "window.window_at": U([-0.5, 0.8], [0.5, 1.2]),
        "door.full_size": U([0.05, 2.6, 2.3], [0.2, 3.2, 2.6]),
        "door.door": U([0.6, 1.8], [1.2, 2.1]),
        "door.door_at": U(-0.5, 0.5),
        "ramp.run": U(1.0, 2.0),
        "ramp.rise": U(0.2, 0.8),
        "ramp.friction": U([0.7, 0.005, 0.0001], [1.2, 0.005, 0.0001]),
        "fence.heights": U(-0.05, 0.05, relative="add"),
        "fence.thickness": U(0.03, 0.06),
    }
)
RADIUS, SPEED, BEFORE, TIME, G = (
    0.05,
    3.0,
    0.5,
    0.4,
    9.81,
)  # of balls that are thrown from half a metre before the middle
INSIDE = RADIUS + 0.01  # a centimetre is left
ROLLS = "ramp"
THROWN = {
    "through the window": (
        "window",
        lambda n: (n["window_at"][0] + n["window"][0] / 2 - INSIDE, n["window_at"][1] + n["window"][1] / 2),
    ),
    "at the sill": ("window", lambda n: (n["window_at"][0], n["window_at"][1] - 0.01)),
    "through the door": ("door", lambda n: (n["door_at"] - n["door"][0] / 2 + INSIDE, 1.0)),
    "at the lintel": ("door", lambda n: (n["door_at"], n["door"][1] + 0.01)),
    "between the rails": ("fence", lambda n: (0.3, n["heights"][1] - n["thickness"] / 2 - INSIDE)),
    "at a rail": ("fence", lambda n: (-0.3, n["heights"][1])),
}
"""Each with its part, and where y, z it is at the top of its flight in the part's middle, by the part's numbers."""
NAMES = (*(name.replace(" ", "_") for name in THROWN), ROLLS)


@pytest.fixture(scope="module")
def drawn():
    """The arena, and the parameters of its worlds."""
    arena = mja.TableArena(objects=[mja.Object(f"ball_{name}", "sphere", 2 * RADIUS) for name in NAMES])
    for part in PARTS:
        arena.add_part(part)
    params = jax.jit(jax.vmap(lambda key: arena.sample_params(key, RANGES)))(mja.world_keys(0, range(4)))
    assert jax.vmap(lambda p: arena.valid(p, RANGES))(params).all()
    return arena, params


def numbers(params, w, part):
    """Of a part in a world, by name, and its axes (3, 3)."""
    found = {
        name.split(".")[1]: np.asarray(x[w], float) for name, x in params.terms.items() if name.startswith(f"{part}.")
    }
    found = {name: x if name == "heights" else x[0] for name, x in found.items()}
    cos, sin = np.cos(found["rot"]), np.sin(found["rot"])
    return found, np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


def starts(params, w):
    """(K, 3) where the balls are at first, and (K, 3) their velocities."""
    pos, vel, until = [], [], BEFORE / SPEED
    for part, aim in THROWN.values():
        n, axes = numbers(params, w, part)
        y, z = aim(n)
        pos.append(n["pos"] + axes @ (-BEFORE, y, z - G * until**2 / 2))
        vel.append(axes @ (SPEED, 0, G * until))
    n, axes = numbers(params, w, ROLLS)
    along, up = slope(n)
    pos.append(n["pos"] + axes @ (0.9 * np.hypot(n["run"], n["rise"]) * along + RADIUS * up))
    return np.array(pos), np.array([*vel, np.zeros(3)])


def slope(n):
    """Directions up a ramp, and away from it."""
    along = np.array([n["run"], 0, n["rise"]]) / np.hypot(n["run"], n["rise"])
    return along, np.array([-along[2], 0, along[0]])


def after(engine, arena, params):
    """(W, K, 3) where the balls are after `TIME`."""
    at, dofs = (
        arena.layout.object_qpos[:, :3],
        arena.mj_model.body_dofadr[arena.layout.object_body][:, None] + np.arange(3),
    )
    count = len(params.table_rots)
    steps = round(TIME / arena.mj_model.opt.timestep)
    begin = [starts(params, w) for w in range(count)]
    if engine == "c":
        found = []
        for w, (pos, vel) in enumerate(begin):
            model, c = arena.c_world(jax.tree.map(lambda x, w=w: np.asarray(x)[w], params))
            c.qpos[at], c.qvel[dofs] = pos, vel
            mujoco.mj_step(model, c, nstep=steps)
            found.append(c.qpos[at])
        return np.array(found)
    batch = arena.randomize(arena.put_model(engine), mja.world_keys(0, range(count)), RANGES)
    np.testing.assert_array_equal(batch.params.terms["door.door"], params.terms["door.door"])
    pos, vel = (jnp.asarray(np.array(x), jnp.float32) for x in zip(*begin, strict=True))
    data = mja.make_data(batch)
    data = data.replace(qpos=data.qpos.at[:, at].set(pos), qvel=data.qvel.at[:, dofs].set(vel))
    return np.asarray(mja.rollout(batch, data, steps).qpos, float)[:, at]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["c", "jax", "warp"])
def test_collides(drawn, engine):
    """What is thrown a centimetre inside an edge flies on freely, a centimetre outside it stays in front; a ball rolls as on an incline."""
    arena, params = drawn
    ends, dt = after(engine, arena, params), arena.mj_model.opt.timestep
    rounding = round(TIME / dt) * oracle.EPS * 8  # one in each step, of coordinates below 8 m
    for w, end in enumerate(ends):
        pos, vel = starts(params, w)
        for k, (name, (part, _)) in enumerate(THROWN.items()):
            n, axes = numbers(params, w, part)
            if not name.startswith("at"):
                free = pos[k] + TIME * vel[k] - [0, 0, G * TIME * (TIME + dt) / 2]  # as Euler's steps have it
                np.testing.assert_allclose(end[k], free, rtol=0, atol=rounding, err_msg=name)
                continue
            face = -n["full_size"][0] / 2 if part != "fence" else -1.5 * n["thickness"]
            x = (axes.T @ (end[k] - n["pos"]))[0]
            assert face - RADIUS - 0.1 < x < face - RADIUS + 0.001, name
        n, axes = numbers(params, w, ROLLS)
        along, up = slope(n)
        moved = axes.T @ (end[-1] - pos[-1])
        assert moved @ along == pytest.approx(-5 / 7 * G * along[2] * TIME * (TIME + dt) / 2, rel=0.005)
        assert abs(moved @ up) < 5e-4
