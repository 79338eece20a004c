"""Draws docs/scenes.png: `python docs/scenes.py ROBOT.xml` (a Franka Panda: see tests/robots.txt)."""

import pathlib
import sys

import jax
import numpy as np

import mjx_arenas as mja

PICTURES = 12
SHAPES = (
    ("box", (0.09, 0.09, 0.09)),
    ("cylinder", (0.08, 0.08, 0.12)),
    ("sphere", 0.1),
    ("capsule", (0.18, 0.06, 0.06)),
    ("box", (0.16, 0.08, 0.06)),
)


def main(robot: str) -> None:
    """A robot on its table, up to three tables more, up to ten objects on any of them."""
    objects = [mja.Object(f"object{i}", *SHAPES[i % len(SHAPES)], on=1 + i % 3) for i in range(10)]
    offsets = [[0, 0, 0.8], [0.1, 1.1, 0.8], [1.1, -0.1, 0.8], [1.1, 1.1, 0.8]]
    arena = mja.MultiTableArena(offsets, objects=objects)
    arena.attach(robot, pos=(-0.2, 0, 0), on=0)
    ranges = mja.ArenaRanges(
        table_offsets=mja.Uniform([0, 0, -0.25], [0, 0, 0.15], relative="add"),
        table_rots=mja.Uniform(-np.pi, np.pi),
        table_full_sizes=mja.Uniform([0.6, 0.5, 0.02], [0.9, 0.8, 0.1]),
        has_legs=mja.Bernoulli(0.7),
        table_active=mja.Bernoulli([1.0, 0.6, 0.6, 0.6]),
        object_full_sizes=mja.Uniform(0.7, 1.3, relative="scale", tied="axes"),
        object_tables=mja.Choice([0, 1, 2, 3]),
        object_active=mja.Count(0, 10),
        workspace=mja.Workspace([-1.0, -1.0], [1.9, 1.9], gap=0.05),
    )
    keys = jax.random.split(jax.random.key(0), PICTURES)
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    assert batch.valid.all()
    labels = []
    for i in range(PICTURES):
        params = batch.world(i)
        tables, there = int(params.table_active.sum()), int(params.object_active.sum())
        labels.append(f"world {i}: {tables} table{'s' * (tables != 1)}, {there} object{'s' * (there != 1)}")
    path = pathlib.Path(__file__).parent / "scenes.png"
    arena.contact_sheet(batch.params, mja.make_data(batch, keys), labels).save(path, optimize=True)
    print(f"written to {path}")


if __name__ == "__main__":
    main(sys.argv[1])
