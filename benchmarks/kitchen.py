"""A kitchen of forty boxes and eight objects: what it costs to draw, to step and to recompile."""

import functools
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

import mjx_arenas as mja
from benchmarks import measure, scene
from benchmarks.rivals import MAX_DIFFERENCE, WarpAlone
from mjx_arenas import furniture

U = mja.Uniform


def arena() -> mja.TableArena:
    """A table with eight objects, the first called "box", among furniture of forty boxes."""
    names = ["box", *(f"thing{i}" for i in range(1, 8))]
    objects = [mja.Object(name, full_size=(0.05, 0.06, 0.04 + 0.01 * i)) for i, name in enumerate(names)]
    one = mja.TableArena((0.8, 1.2, 0.04), table_offset=(0.2, 0, 0.75), objects=objects)
    for part in (
        furniture.Wall("wall", pos=(2.4, -0.5, 0), full_size=(0.1, 4.4, 2.5), window=(1.2, 0.9)),
        furniture.Counter("counter", pos=(2.34, -2.6, 0), widths=(0.6, 0.6, 0.6, 0.6, 0.6)),
        furniture.Shelf("rack", pos=(1.5, 1.95, 0), rot=1.5708, heights=(0.3, 0.8, 1.3)),
        furniture.Drawers("drawers", pos=(0.6, 1.9, 0), rot=1.5708, heights=(0.25, 0.2), openings=(0.0, 0.0)),
        furniture.Bin("crate", pos=(-0.8, 0.5, 0), inner_size=(0.25, 0.18, 0.1)),
    ):
        one.add_part(part)
    return one


SURFACES = (
    "table",
    "counter_top0",
    "counter_top2",
    "counter_top4",
    "rack_board1",
    "rack_board2",
    "drawers_top",
    "crate_bottom",
)
"""Where objects stand, as likely on each."""


def ranges() -> mja.ArenaRanges:
    """Sizes, heights, widths, places, openings, friction, colours and presence; what each object stands on."""
    surfaces = arena().surfaces
    return mja.ArenaRanges(
        object_tables=mja.Choice([surfaces.index(name) for name in SURFACES]),
        table_offsets=U([-0.1, -0.1, 0], [0.1, 0.1, 0], relative="add"),
        table_frictions=U([0.8, 1, 1], [1.2, 1, 1], relative="scale"),
        object_full_sizes=U(0.8, 1.2, relative="scale"),
        terms={
            "counter.widths": U(0.4, 0.6),
            "counter.height": U(0.8, 1.0),
            "counter.rgba": U([0.3, 0.3, 0.3, 1], [0.9, 0.9, 0.9, 1]),
            "wall.window": U([0.6, 0.5], [1.6, 1.1]),
            "rack.heights": U(-0.12, 0.12, relative="add"),
            "rack.pieces_active": mja.Bernoulli(0.75),
            "rack.size": U([0.25, 0.6], [0.4, 1.0]),
            "rack.friction": U(0.5, 1.5, relative="scale"),
            "drawers.heights": U(0.12, 0.25),
            "drawers.openings": U(0.0, 0.25),
            "crate.pos": U([-0.1, -0.2, 0], [0.1, 0.1, 0], relative="add"),
            "crate.inner_size": U(0.8, 1.2, relative="scale"),
        },
    )


def kitchen(impl: str, worlds: int, n_steps: int, agree_steps: int, recompiled: int) -> Iterator[dict[str, Any]]:
    """Drawing beside steps of the same worlds, these beside mujoco_warp's, and MuJoCo's compiler on one core."""
    one, given = arena(), ranges()
    model, keys = scene.model(one, impl), scene.keys(worlds)
    batch = one.randomize(model, keys, given)
    data = mja.make_data(batch, keys)
    write = jax.jit(lambda keys: scene.written(one.randomize(model, keys, given)))
    runs = {
        "randomize": functools.partial(write, keys),
        "steps": functools.partial(mja.rollout, batch, data, n_steps),
    }
    beside: dict[str, Any] = {}
    if impl == "warp":
        alone = WarpAlone(batch, data)
        ours = mja.rollout(batch, data, n_steps=agree_steps).qpos
        off = np.abs(np.asarray(ours) - alone.rollout(agree_steps)).max()
        if not off < MAX_DIFFERENCE:
            raise RuntimeError(f"comparison void: trajectories differ by {off:.1e} m")
        runs["alone"] = functools.partial(alone.rollout, n_steps, read=False)
        beside["largest_qpos_difference"] = float(off)
    seconds = measure.interleaved(runs)
    if impl == "warp":
        beside["ours_over_alone"] = seconds["alone"] / seconds["steps"]
    some = [jax.tree.map(np.asarray, batch.world(i)) for i in range(min(recompiled, worlds))]
    compiled = measure.interleaved({"recompile": lambda: [one.compile(params).nq for params in some]})["recompile"]
    yield {
        "impl": impl,
        "worlds": worlds,
        "geoms": one.mj_model.ngeom,
        "seconds": seconds["randomize"],
        "step_seconds": seconds["steps"] / n_steps,
        "in_steps": seconds["randomize"] / (seconds["steps"] / n_steps),
        "steps_per_second": worlds * n_steps / seconds["steps"],
        "times_recompiling": worlds / seconds["randomize"] * compiled / len(some),
        **beside,
    }


GOALS = ("table", "counter_top0", "counter_top2", "rack_board1", "crate_bottom")


def transfer(impl: str, worlds: int, length: int) -> Iterator[dict[str, Any]]:
    """Carrying a box between surfaces, in new kitchens in every episode, beside kitchens that stay what they are."""
    from benchmarks import when_needed
    from mjx_arenas.envs import Transfer

    one = arena()
    starts = mja.Choice([one.surfaces.index(name) for name in GOALS])
    given = ranges()._replace(object_tables=starts)

    def make(kind: Any) -> Any:
        return kind(Transfer)(config_overrides={"impl": impl}, ranges=given, arena=arena(), goals=GOALS, reach=3.0)

    yield from when_needed.shares(make, worlds, length)
