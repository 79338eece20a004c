"""The scene of all cases: tables with four legs each, 5 cm cubes that start a few millimetres above them, a floor."""

import functools
import operator
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas.demo import ranges
from mjx_arenas.envs import arms
from mjx_arenas.sim.warp_notes import quiet

DROP = 0.003  # [m]
SPACING = 1.3  # [m] between tables

__all__ = ["arena", "keys", "model", "ranges", "start", "with_an_arm", "written"]


@functools.cache
def arena(n_tables: int = 3, n_objects: int = 3, one_table: bool = False) -> mja.MultiTableArena:
    """The arena, one object for all cases of a process, so that what was compiled for it is used again.

    Args:
        n_tables: they stand in a square grid.
        n_objects: cubes, in turns on the tables.
        one_table: all cubes on the first table instead.
    """
    side = int(np.ceil(np.sqrt(n_tables)))
    offsets = [(SPACING * (i % side), SPACING * (i // side), 0.8) for i in range(n_tables)]
    cubes = [mja.Object(f"cube{k}", on=0 if one_table else k % n_tables) for k in range(n_objects)]
    scene = mja.MultiTableArena(table_offsets=offsets, objects=cubes)
    option = scene.spec.option
    option.solver, option.cone = mujoco.mjtSolver.mjSOL_NEWTON, mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.iterations, option.ls_iterations, option.timestep = 5, 8, 0.004
    return scene


def with_an_arm() -> mja.TableArena:
    """An arm with a gripper on a table with three cubes."""
    scene = mja.TableArena((0.9, 0.9, 0.05), objects=[mja.Object(f"cube{k}") for k in range(3)])
    scene.attach(arms.small().spec, "arm_", pos=(-0.15, 0, 0), on=0)
    return scene


@functools.cache
def model(scene: mja.MultiTableArena, impl: str) -> mjx.Model:
    """Its nominal model on the device; Warp does not print that 8 line-search iterations were too few, in loops of others either."""
    return quiet(scene.put_model(impl))


def keys(n_worlds: int) -> jax.Array:
    """A key for each world."""
    return jax.random.split(jax.random.key(0), n_worlds)


def start(scene: mja.MultiTableArena, impl: str, n_worlds: int) -> tuple[mja.ArenaBatch, mjx.Data]:
    """Random worlds, cubes just above their tables."""
    batch = scene.randomize(model(scene, impl), keys(n_worlds), ranges())
    return batch, dropped(batch)


def dropped(batch: mja.ArenaBatch) -> mjx.Data:
    """Data of a batch, cubes just above their tables."""
    data = mja.make_data(batch, keys(batch.n_worlds))
    return data.replace(qpos=data.qpos.at[:, batch.record.layout.object_qpos[:, 2]].add(DROP))


def written(batch: mja.ArenaBatch) -> tuple[Any, ...]:
    """All arrays that `randomize` writes."""
    return tuple(operator.attrgetter(name)(batch.model) for name in batch.fields), batch.params, batch.valid
