"""Stepping worlds: what random models cost, how cost grows with worlds and tables, and resets."""

import dataclasses
import functools
import operator
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from mujoco import mjx

import mjx_arenas as mja
from benchmarks import measure, memory, scene
from mjx_arenas.params.params import canonical
from mjx_arenas.sim.batch import constants_ahead
from mjx_arenas.sim.data import Impl, put_model
from mjx_arenas.sim.warp_notes import quiet


def kinds(worlds: Mapping[str, int], n_steps: int) -> Iterator[dict[str, Any]]:
    """One shared model under plain `mjx.step`; the batched leaves with equal values; with random ones."""
    for impl, n in worlds.items():
        random, data = scene.start(scene.arena(), impl, n)
        same = _with_equal_leaves(random)
        same_data = scene.dropped(same)
        shared = functools.partial(_plain_rollout, scene.model(scene.arena(), impl), same_data, n_steps)
        runs = {
            "shared": shared,
            "same": functools.partial(mja.rollout, same, same_data, n_steps),
            "random": functools.partial(mja.rollout, random, data, n_steps),
        }
        off = jnp.abs(shared().qpos - mja.rollout(same, same_data, n_steps).qpos).max()
        seconds = measure.interleaved(runs)
        yield {
            "impl": impl,
            "worlds": n,
            **{f"{name}_steps_per_second": n * n_steps / s for name, s in seconds.items()},
            "same_over_shared": seconds["shared"] / seconds["same"],
            "random_over_shared": seconds["shared"] / seconds["random"],
            "largest_qpos_difference": float(off),
        }


def _with_equal_leaves(batch: mja.ArenaBatch) -> mja.ArenaBatch:
    """The same leaves batched, with the nominal values in all worlds."""

    def repeated(x: jax.Array) -> jax.Array:
        return jnp.array(jnp.broadcast_to(x, (batch.n_worlds, *x.shape)))

    nominal = quiet(put_model(batch.record.mj_model, batch.model.impl.value))
    leaves = {name: repeated(operator.attrgetter(name)(nominal)) for name in batch.fields}
    params = jax.tree.map(repeated, canonical(batch.record.nominal))
    return dataclasses.replace(batch, model=batch.model.tree_replace(leaves), params=params)


@functools.partial(jax.jit, static_argnames="n_steps")
def _plain_rollout(model: mjx.Model, data: mjx.Data, n_steps: int) -> mjx.Data:
    step = jax.vmap(mjx.step, in_axes=(None, 0))
    if model.impl == Impl.WARP:  # as `rollout` does
        step = constants_ahead(step, model, data)

    def body(data: mjx.Data, _: None) -> tuple[mjx.Data, None]:
        return step(model, data), None

    return jax.lax.scan(body, data, length=n_steps)[0]


def tables(worlds: Mapping[str, int], counts: Sequence[int], n_steps: int) -> Iterator[dict[str, Any]]:
    """The same three cubes on the first table, more and more tables beside it."""
    for impl, n in worlds.items():
        runs = {
            t: functools.partial(mja.rollout, *scene.start(scene.arena(t, 3, True), impl, n), n_steps) for t in counts
        }
        seconds = measure.interleaved({str(t): run for t, run in runs.items()})
        for t in counts:
            yield {
                "impl": impl,
                "tables": t,
                "worlds": n,
                "steps_per_second": n * n_steps / seconds[str(t)],
                "time_over_fewest": seconds[str(t)] / seconds[str(counts[0])],
            }


def throughput(worlds: Mapping[str, Sequence[int]], n_steps: int) -> Iterator[dict[str, Any]]:
    """Random worlds; `floor` is the time of a plain device copy of all bytes that a step has to touch once."""
    for impl, counts in worlds.items():
        runs = {n: functools.partial(mja.rollout, *scene.start(scene.arena(), impl, n), n_steps) for n in counts}
        for n in counts:
            run = runs.pop(n)
            nbytes = memory.touched(run.args[0], run())
            seconds = measure.interleaved({"rollout": run})["rollout"] / n_steps
            floor = nbytes * measure.copy_seconds_per_byte()
            yield {
                "impl": impl,
                "worlds": n,
                "steps_per_second": n / seconds,
                "touched_bytes_per_world": nbytes / n,
                "floor_steps_per_second": n / floor,
                "floor_over_time": floor / seconds,
            }


def reset(worlds: Mapping[str, int], n_steps: int) -> Iterator[dict[str, Any]]:
    """New worlds with absent tables and cubes, cubes placed, data made; all compiled as one; in units of a step."""
    arena = scene.arena()
    present = {"table_active": mja.Bernoulli([1.0, 0.5, 0.5]), "object_active": mja.Count(1, 3)}
    ranges = scene.ranges()._replace(**present)
    for impl, n in worlds.items():
        model, keys = scene.model(arena, impl), scene.keys(n)

        def new(keys: jax.Array, model: mjx.Model = model) -> tuple[Any, mjx.Data]:
            batch = arena.randomize(model, keys, ranges)
            return scene.written(batch), mja.make_data(batch, keys)

        batch, data = scene.start(arena, impl, n)
        place = jax.jit(jax.vmap(arena.place))
        seconds = measure.interleaved(
            {
                "reset": functools.partial(jax.jit(new), keys),
                "make_data": functools.partial(mja.make_data, batch, keys),
                "place": functools.partial(place, batch.params, keys),
                "step": functools.partial(mja.rollout, batch, data, n_steps),
            }
        )
        step = seconds.pop("step") / n_steps
        yield {
            "impl": impl,
            "worlds": n,
            **{f"{name}_seconds": s for name, s in seconds.items()},
            "step_seconds": step,
            "reset_in_steps": seconds["reset"] / step,
        }
