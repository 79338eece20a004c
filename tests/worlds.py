"""Random arenas for the tests, and their comparison."""

import pathlib

import jax
import mujoco
import numpy as np

import mjx_arenas as mja

SPACING = 1.6  # of nominal table centres [m]; the largest table of RANGES is 1.42 m across its diagonal, and moves 5 cm

OBJECTS = (
    mja.Object("cube", "box", 0.05),
    mja.Object("ball", "sphere", 0.06),
    mja.Object("rod", "capsule", (0.12, 0.04, 0.04)),
)

TABLES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.05, -0.05, -0.35], [0.05, 0.05, 0.45], relative="add"),
    table_rots=mja.Uniform(-4.0, 4.0),
    table_full_sizes=mja.Uniform([0.3, 0.3, 0.01], [1.0, 1.0, 0.3]),
    table_frictions=mja.LogUniform([0.05, 0.005, 0.0001], [1.0, 0.005, 0.0001]),
    has_legs=mja.Bernoulli(0.5),
)
RANGES = TABLES._replace(
    object_full_sizes=mja.Uniform(0.8, 1.2, relative="scale"),
    object_densities=mja.LogUniform(0.3, 3.0, relative="scale"),
    object_rgba=mja.Uniform(0.0, 1.0),
)

CHILDREN = pathlib.Path(__file__).parent / "children"  # of PYTHONPATH where a test starts a Python that steps on Warp


def offsets(n_tables):
    side = int(np.ceil(np.sqrt(n_tables)))
    return [((i % side) * SPACING, (i // side) * SPACING, 0.8) for i in range(n_tables)]


def arena(n_tables, objects=OBJECTS, **kwargs):
    on = [
        mja.Object(f"{o.name}{t}" if t else o.name, o.type, o.full_size, on=t)
        for t in range(n_tables)
        for o in objects[: 3 if n_tables == 1 else 1 + t % 2]
    ]
    return mja.MultiTableArena(table_offsets=offsets(n_tables), objects=on, **kwargs)


def leaves(tree):
    """All arrays of a pytree of MJX, those that are part of its structure too, by their path."""
    found = {
        jax.tree_util.keystr(path)[1:]: np.asarray(leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(tree)
    }
    for prefix, node in (("", tree), ("opt.", tree.opt), ("_impl.", tree._impl)):
        for field in node.fields():
            value = getattr(node, field.name)
            if isinstance(value, np.ndarray):
                found.setdefault(prefix + field.name, value)
    return found


def forward(model):
    """C data of a model as it starts, with all that follows from its positions."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def take(params, i):
    """Parameters of world i, in NumPy, which compiles nothing for each shape."""
    return jax.tree.map(lambda x: np.asarray(x)[i], params)


def rest_heights(arena, params):
    """(W, K) heights [m] of the origins of objects that are centred when they touch their tables; params (W, ...)."""
    offsets, tables = np.asarray(params.table_offsets), np.asarray(params.object_tables)
    return np.take_along_axis(offsets[:, :, 2], tables, axis=1) + np.asarray(params.object_full_sizes)[:, :, 2] / 2


def elliptic(arena):
    """The arena, with the friction cone that tasks which hold something ask for."""
    arena.spec.option.cone, arena.spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10
    return arena
