"""Products of matrices keep full precision on a GPU, where JAX by default rounds what it multiplies to ten bits of mantissa."""

import jax
import jax.numpy as jnp
import pytest
from whole import with_everything

import mjx_arenas as mja

FULL = (jax.lax.Precision.HIGHEST,) * 2


def inner(value):
    """Programs among the parameters of an operation."""
    if isinstance(value, (tuple, list)):
        for item in value:
            yield from inner(item)
    elif isinstance(value, jax.extend.core.ClosedJaxpr):
        yield value.jaxpr
    elif isinstance(value, jax.extend.core.Jaxpr):
        yield value


def products(program):
    """All products of a program, also those within loops, branches and calls."""
    for operation in program.eqns:
        if operation.primitive.name == "dot_general":
            yield operation
        for value in operation.params.values():
            for part in inner(value):
                yield from products(part)


def rounded(function, *args):
    """Where a function multiplies with less than full precision, and how many products it has."""
    found = list(products(jax.make_jaxpr(function)(*args).jaxpr))
    return [str(one.source_info.traceback) for one in found if one.params["precision"] != FULL], len(found)


def test_the_rule_sees_a_product():
    """In a loop, too."""

    def f(x):
        return jax.lax.fori_loop(0, 2, lambda _, x: jax.lax.cond(x[0, 0] > 0, lambda: x @ x, lambda: x), x)

    assert len(rounded(f, jnp.eye(2))[0]) == rounded(f, jnp.eye(2))[1] == 1


@pytest.mark.slow
def test_worlds():
    """Of a furnished arena: drawn, written, and with their objects placed."""
    arena, ranges = mja.load("kitchen")
    model, keys = arena.put_model(), jax.random.split(jax.random.key(0), 2)
    found, n = rounded(lambda keys: mja.make_data(arena.randomize(model, keys, ranges), keys), keys)
    assert found == []
    assert n


def test_robots():
    """Of which all varies."""
    arena = with_everything("humanoid", "jax")
    found, n = rounded(lambda params: arena.fields(arena.put_model(), params), arena.nominal_params())
    assert found == []
    assert n


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["Reach", "Lift", "PickAndPlace", "OpenDrawer"])
def test_tasks(kind):
    """Of arms: goals, controls, observations and rewards."""
    env = getattr(pytest.importorskip("mjx_arenas.envs"), kind)()
    state = jax.eval_shape(env.reset, jax.random.key(0))
    episode = state.info["episode"]

    def parts(data, episode, key, action):
        task = env.draw_task(key, episode.params, data.qpos)
        return task, env.drive(data, episode, action), env.observe(data, episode), env.score(data, episode, action)

    found, n = rounded(parts, state.data, episode, jax.random.key(0), jnp.zeros(env.action_size))
    assert found == []
    assert n
