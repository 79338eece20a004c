"""Rollouts of a batch: many steps, compiled as one function."""

import functools
from collections.abc import Callable
from typing import Any, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jax.tree_util import Partial
from mujoco import mjx

from mjx_arenas.keywords import with_known_arguments
from mjx_arenas.problem import Told, problem
from mjx_arenas.rules import validation
from mjx_arenas.sim import batch as batch_
from mjx_arenas.sim import devices, warp_notes
from mjx_arenas.sim.batch import ArenaBatch

Control: TypeAlias = Callable[[mjx.Data, jax.Array], jax.Array] | jax.Array | np.ndarray


@with_known_arguments
def rollout(
    batch: ArenaBatch,
    data: mjx.Data,
    n_steps: int,
    record: Callable[[mjx.Data], Any] | None = None,
    control: Control | None = None,
) -> Any:
    """Takes `n_steps` steps in all worlds, compiled as one function.

    Args:
        batch: W worlds.
        data: data of all worlds, from `make_data` of this batch. Data of another arena with the same sizes cannot be detected.
        n_steps: number of steps; another number compiles again.
        record: function of the data of all worlds after each step, whose results are kept, e.g. `lambda d: d.qpos`. Pass the same function
            object again to reuse the compiled program.
        control: `data.ctrl` (W, nu) in each step. Either an array, (n_steps, W, nu), or (n_steps, nu) for the same control in all worlds.
            Or a function that returns (W, nu) from the data of all worlds before a step and the number of that step, from 0. Pass a
            policy's parameters that change without a new compilation as `jax.tree_util.Partial(function, parameters)`. None: `data.ctrl`
            stays.

    Returns:
        The data after the last step. With `record`, a pair of that data and the records, stacked (n_steps, ...).

    Raises:
        ValueError, TypeError: an argument makes no sense, or a function for `control` returns another shape.
    """
    n_steps = validation.whole("n_steps", n_steps, 0)
    if record is not None and not callable(record):
        raise validation.error(
            [problem("record", "must", None, record, must="a function of the data, such as lambda d: d.qpos, or None")],
            kind=TypeError,
        )
    if record is not None:
        validation.check_takes("record", record, ("data",))
    batch_.check_types(batch, data)
    batch_.check_devices(batch, data)
    control = _checked(control, batch, n_steps)
    spread = devices.spread_of(batch.params.table_rots)
    with warp_notes.no_room_answered():
        data, records = _rollout(batch, data, n_steps, record, control, spread)
    if spread is None:  # a sum over devices would be a collective
        warp_notes.NOTES.take(data)
    return data if record is None else (data, records)


def _checked(control: Control | None, batch: ArenaBatch, n_steps: int) -> Any:
    """The same as a tree of arrays, on the devices of the worlds."""
    if control is None:
        return None
    if callable(control):
        validation.check_takes("control", control, ("data", "step"))
        return control if isinstance(control, Partial) else Partial(control)
    n_worlds, nu = batch.n_worlds, batch.model.nu
    kinds = (jnp.floating, jnp.integer)
    if not isinstance(control, (jax.Array, np.ndarray)) or not any(jnp.issubdtype(control.dtype, k) for k in kinds):
        got = f"{control.dtype} numbers" if hasattr(control, "dtype") else type(control).__name__
        raise validation.error(
            [
                problem(
                    "control", "must", None, Told(got), must="an array of numbers, a function of data and step, or None"
                )
            ],
            kind=TypeError,
        )
    shapes = (n_steps, n_worlds, nu), (n_steps, nu)
    if control.shape not in shapes:
        raise validation.error(
            [problem("control", "control_shape", None, control.shape, each=shapes[0], same=shapes[1])]
        )
    return devices.beside(batch.params.table_rots, jax.device_put(control))


@functools.partial(jax.jit, static_argnames=("n_steps", "record", "spread"))
def _rollout(
    batch: ArenaBatch,
    data: mjx.Data,
    n_steps: int,
    record: Callable[[mjx.Data], Any] | None,
    control: Any,
    spread: devices.Spread | None,
) -> tuple[mjx.Data, Any]:
    step = batch_.stepper(batch, data, spread)
    by_step = None if callable(control) else control

    def body(data: mjx.Data, now: tuple[jax.Array, jax.Array | None]) -> tuple[mjx.Data, Any]:
        index, row = now
        if control is not None:
            data = data.replace(ctrl=_given(control(data, index), data) if callable(control) else _row(row, data))
        data = step(batch, data)
        return data, None if record is None else record(data)

    return jax.lax.scan(body, data, (jnp.arange(n_steps), by_step))


def _row(row: Any, data: mjx.Data) -> jax.Array:
    """(W, nu) of an array's row, (W, nu) or (nu,)."""
    row = jnp.broadcast_to(row, data.ctrl.shape) if row.ndim == 1 else row
    return row.astype(data.ctrl.dtype)


def _given(ctrl: Any, data: mjx.Data) -> jax.Array:
    """What a function gave, if it is as it must be."""
    shape = getattr(ctrl, "shape", None)
    if shape != data.ctrl.shape:
        got = type(ctrl).__name__ if shape is None else f"shape {shape}"
        raise validation.error([problem("control", "control_given", None, Told(got), wanted=data.ctrl.shape)])
    return jnp.asarray(ctrl, data.ctrl.dtype)
