"""One to eight of each part in one arena: each world as the compiler makes it, whatever is there, and things rest on all of them."""

import jax
import mujoco
import numpy as np
import oracle
import pytest

import mjx_arenas as mja
from mjx_arenas import furniture
from mjx_arenas.furniture import layouts
from mjx_arenas.record.elsewhere import elsewhere

pytestmark = pytest.mark.slow

ON = {
    furniture.Shelf: "board1",
    furniture.Bin: "bottom",
    furniture.Counter: "top1",
    furniture.Drawers: "drawer2_bottom",
    furniture.Cupboard: "top",
    furniture.Steps: "step1",
    furniture.Zone: None,
}
"""Parts on which a thing stands, and where."""
NOTHING_ON = (furniture.Wall, furniture.Ramp, furniture.Rail)


def many(n):
    """An arena with `n` of each part, and a box on each that has a surface."""
    kinds = [*ON, *NOTHING_ON]
    parts = [kind(f"{kind.__name__.lower()}{i}") for i in range(n) for kind in kinds]
    arena = mja.TableArena()
    for part in layouts.grid(parts, len(kinds), (6.0, 6.0), pos=(3, 0, 0)):
        arena.add_part(part)
    for i in range(n):
        for kind, where in ON.items():
            name = f"{kind.__name__.lower()}{i}"
            surface = f"{name}_{where}" if where else name
            arena.add_object(mja.Object(f"on_{name}", full_size=(0.06, 0.05, 0.04), on=surface))
    return arena


@pytest.mark.parametrize("n", [1, 2, 4, 8])
def test_worlds_are_compiled(n):
    """All numbers of all parts others than nominal: each field as in the recompiled model."""
    arena = many(n)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    numbers = [name for name in arena.quantities if not name.endswith("active") and "opening" not in name]
    assert len(numbers) > 30 * n
    template = arena.put_model("jax")
    write = jax.jit(lambda p: arena.apply(template, p))
    for far in (1.0, -0.5):
        params = elsewhere(nominal, arena.record.parts, numbers, far)
        assert oracle.from_compiled(write(params), arena.compile(params)) <= oracle.STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.parametrize("n", [1, 4])
def test_presence(n):
    """With each part there or not, by chance, what is there has the compiled world's numbers, and the rest is parked."""
    arena = many(n)
    active = [name for name in arena.quantities if name.endswith("active")]
    ranges = mja.ArenaRanges(terms=dict.fromkeys(active, mja.Bernoulli(0.5)))
    write = jax.jit(lambda p, template: arena.apply(template, p))
    template, seen = arena.put_model("jax"), set()
    for key in mja.world_keys(4, range(10)):
        params = jax.tree.map(np.asarray, arena.sample_params(key, ranges))
        model, compiled = write(params, template), arena.compile(params)
        there = {compiled.geom(i).name for i in range(compiled.ngeom)}
        for i in range(arena.mj_model.ngeom):
            geom = arena.mj_model.geom(i)
            if geom.name in there:
                np.testing.assert_allclose(model.geom_size[i], compiled.geom(geom.name).size, rtol=1e-6)
                np.testing.assert_allclose(model.geom_pos[i], compiled.geom(geom.name).pos, rtol=1e-6, atol=1e-7)
            else:
                assert model.geom_rgba[i, 3] == 0
                body, carrying = int(geom.bodyid[0]), []
                while body:
                    carrying.append(body)
                    body = int(arena.mj_model.body_parentid[body])
                parked = (model.body_pos[np.array(carrying), 2] > 500).any()  # itself, or what carries it
                assert parked or arena.mj_model.body_dofnum[carrying[-1]] == 6
        bodies = {compiled.body(b).name for b in range(1, compiled.nbody)}
        assert {arena.mj_model.body(arena.mj_model.geom(name).bodyid[0]).name for name in there} - {"world"} <= bodies
        seen |= {name for name in active if not np.all(params.terms[name])}
    assert seen == set(active)


def test_things_rest(impl):
    """On each part a thing stays where it is put, at the height of its surface; in MJX as in C."""
    arena = many(1)
    keys = mja.world_keys(0, range(2))
    names = [name for name in arena.quantities if name.split(".")[1] in ("height", "heights", "inner_size", "rises")]
    assert len(names) >= 4
    ranges = mja.ArenaRanges(terms=dict.fromkeys(names, mja.Uniform(0.9, 1.1, relative="scale")))
    batch = arena.randomize(arena.put_model(impl), keys, ranges)
    assert batch.valid.all()
    start = mja.make_data(batch, keys)
    data = mja.rollout(batch, start, 60)
    for w in range(2):
        params = jax.tree.map(np.asarray, batch.world(w))
        rest = np.asarray(arena.rest_heights(params))
        model, c = arena.c_world(params, key=keys[w])
        for _ in range(60):
            mujoco.mj_step(model, c)
        for k, name in enumerate(o.name for o in arena.objects):
            at = arena.layout.object_qpos[k]
            assert c.body(name).xpos[2] == pytest.approx(rest[k], abs=5e-4), name
            np.testing.assert_allclose(np.asarray(data.qpos[w])[at[:3]], c.body(name).xpos, atol=5e-4, err_msg=name)
