"""Objects that are one of several in each world: what the variants that are not there cost."""

import functools
import pathlib
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import numpy as np
from scipy.spatial import ConvexHull

import mjx_arenas as mja
from benchmarks import measure, scene

OBJECTS = 4
POINTS = 40  # of a mesh, before its hull


def _mesh(folder: pathlib.Path, seed: int) -> pathlib.Path:
    """The path of a convex mesh, a stone of 8 cm."""
    points = np.random.default_rng(seed).normal(size=(POINTS, 3))
    points *= 0.04 / np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
    for face, normal in zip(hull.simplices, hull.equations[:, :3], strict=True):
        a, b, c = points[face]
        order = face if np.cross(b - a, c - a) @ normal > 0 else face[::-1]
        lines.append("f " + " ".join(str(i + 1) for i in order))
    path = folder / f"stone{seed}.obj"
    path.write_text("\n".join(lines))
    return path


def _variant(kind: str, i: int, folder: pathlib.Path) -> mja.Object:
    if kind == "meshes":
        return mja.Object(f"v{i}", "mesh", file=_mesh(folder, i))
    size = 0.05 + 0.004 * i
    shapes = [("box", (size, 0.05, 0.04)), ("sphere", size), ("capsule", (size + 0.04, 0.04, 0.04))]
    return mja.Object(f"v{i}", *shapes[i % 3])


def arena(kind: str, n_variants: int, folder: pathlib.Path) -> mja.TableArena:
    """A table with objects that are each one of so many, with meshes in a folder."""
    variants = [_variant(kind, i, folder) for i in range(n_variants)]
    return mja.TableArena(objects=[mja.Object(f"thing{k}", variants=variants) for k in range(OBJECTS)])


def variants(
    impl: str, worlds: int, n_steps: int, counts: Sequence[int], kinds: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Drawing and stepping objects with one variant and with more, in turns: any of them in each world, and the first in all.

    Where all worlds have the first, shapes are those of the one alone, and what is more is the cost of those that are not there.
    """
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            yield from _of_kind(impl, worlds, n_steps, counts, kind, pathlib.Path(folder))


def _of_kind(
    impl: str, worlds: int, n_steps: int, counts: Sequence[int], kind: str, folder: pathlib.Path
) -> Iterator[dict[str, Any]]:
    runs, keys = {}, scene.keys(worlds)
    cases = [(n, chosen) for n in counts for chosen in ("any", "first") if n > 1 or chosen == "first"]
    for n, chosen in cases:
        one = arena(kind, n, folder)
        which = mja.Choice(list(range(n))) if chosen == "any" else mja.Fixed(0)
        ranges = mja.ArenaRanges(
            table_offsets=mja.Uniform([0, 0, -0.1], [0, 0, 0.1], relative="add"),
            terms={f"thing{k}.variant": which for k in range(OBJECTS)},
        )
        model = scene.model(one, impl)
        batch = one.randomize(model, keys, ranges)
        data = mja.make_data(batch, keys)
        write = jax.jit(
            lambda keys, one=one, model=model, ranges=ranges: scene.written(one.randomize(model, keys, ranges))
        )
        runs[f"randomize {n} {chosen}"] = functools.partial(write, keys)
        runs[f"steps {n} {chosen}"] = functools.partial(mja.rollout, batch, data, n_steps)
    seconds = measure.interleaved(runs)
    fewest = f"{counts[0]} first"
    for n, chosen in cases:
        steps, drawn = seconds[f"steps {n} {chosen}"], seconds[f"randomize {n} {chosen}"]
        yield {
            "impl": impl,
            "kind": kind,
            "variants": n,
            "chosen": chosen,
            "worlds": worlds,
            "objects": OBJECTS,
            "seconds": drawn,
            "step_seconds": steps / n_steps,
            "steps_over_fewest": steps / seconds[f"steps {fewest}"],
            "randomize_over_fewest": drawn / seconds[f"randomize {fewest}"],
        }
