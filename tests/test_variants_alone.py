"""One object whose variants are two meshes, a box and an MJCF: each world is that of the arena with that variant alone, field by field."""

import functools
import pathlib

import jax
import mujoco
import numpy as np
import oracle
import pytest
import worlds
from test_variants import JUG, VARIANTS, off_from_compiled

import mjx_arenas as mja

WEDGE = pathlib.Path(__file__).parent / "data" / "wedge.obj"
TENT = """v -0.05 -0.03 0
v 0.05 -0.03 0
v 0.04 0.05 0
v -0.05 0.03 0
v 0.02 0.01 0.06
f 1 4 3
f 1 3 2
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
"""
"""A pyramid without any symmetry."""


@pytest.fixture(scope="module")
def variants(tmp_path_factory):
    folder = tmp_path_factory.mktemp("variants")
    (folder / "tent.obj").write_text(TENT)
    (folder / "jug.xml").write_text(JUG.format(wedge=WEDGE))
    return (
        mja.Object("wedge", "mesh", file=WEDGE, friction=(0.6, 0.01, 0.0002), rgba=(0.2, 0.6, 0.3, 1)),
        mja.Object("tent", "mesh", file=folder / "tent.obj", mass=0.4, rgba=(0.7, 0.2, 0.6, 1)),
        VARIANTS[0],
        mja.Object("jug", "mjcf", file=folder / "jug.xml"),
    )


def arena_of(**given):
    """A table with this object and a cube."""
    objects = [mja.Object("thing", pos=(0.1, 0.1), rot=0.4, **given), mja.Object("cube")]
    return mja.TableArena(objects=objects, table_priority=0)


@pytest.fixture(scope="module")
def singles(variants):
    """By name arenas in which the object is one variant and nothing else, which no code for variants has seen."""
    fields = ("type", "full_size", "density", "mass", "friction", "condim", "rgba", "file")
    return {v.name: arena_of(**{field: getattr(v, field) for field in fields}) for v in variants}


@pytest.fixture(scope="module")
def together(variants):
    return arena_of(variants=list(variants))


RANGES = mja.ArenaRanges(
    object_densities=mja.LogUniform(0.5, 2.0, relative="scale"),
    object_frictions=mja.Uniform(0.8, 1.2, relative="scale"),
    object_rgba=mja.Uniform(0.5, 1.0, relative="scale"),
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
)


def drawn(arena, name):
    """Numbers of a world with this variant."""
    nominal = arena.with_variants(arena.nominal_params(), thing=name)
    ranges = RANGES._replace(
        terms={"thing.variant": mja.Fixed([v.name for v in arena.objects[0].variants].index(name))}
    )
    params = arena.sample_params(mja.world_keys(3, [0])[0], ranges)
    assert (params.object_masses[0] != nominal.object_masses[0]).all()
    return jax.tree.map(np.asarray, params)


@pytest.mark.slow
@pytest.mark.slow_on("warp")
@pytest.mark.parametrize("name", ["wedge", "tent", "brick"])
def test_shapes(singles, together, name, impl):
    """Every field is the compiler's for the arena with this variant alone, and no other variant's would pass for it."""
    params = drawn(together, name)
    model = together.apply(template(together, impl), params)
    for other in ("wedge", "tent", "brick"):
        sizes = params.object_full_sizes if other == name else singles[other].nominal_params().object_full_sizes
        compiled = singles[other].compile(params._replace(object_full_sizes=sizes, terms={}))
        off = off_from_compiled(together, model, compiled, {"thing_g0": f"thing_{name}_g0"})
        assert bool(off) == (other != name), (other, off)


@pytest.mark.slow_on("warp")
def test_mjcf(singles, together, impl):
    """The geoms of the file's two bodies, and what they weigh together, are those of C's bodies with the file alone."""
    params = drawn(together, "jug")
    got, full = worlds.leaves(together.apply(template(together, impl), params)), together.mj_model
    whole = singles["jug"].compile(params._replace(terms={}))
    c = mujoco.MjData(whole)
    mujoco.mj_forward(whole, c)
    tree = [b for b in range(whole.nbody) if whole.body(whole.body_rootid[b]).name == "thing"]
    theirs = np.flatnonzero(np.isin(whole.geom_bodyid, tree))
    mine = np.array([full.geom(f"thing_jug_{name}").id for name in ("belly", "geom1", "geom2")])
    assert (len(tree), len(theirs)) == (3, 3)
    turn, origin = c.body("thing").xmat.reshape(3, 3), c.body("thing").xpos
    mats = turn.T @ c.geom_xmat[theirs].reshape(-1, 3, 3)
    for field in FIELDS:
        want = getattr(whole, field).copy()
        if field == "geom_pos":
            want[theirs] = (c.geom_xpos[theirs] - origin) @ turn
        if field == "geom_quat":
            want[theirs] = [same_side(quat_of(mat), own) for mat, own in zip(mats, got[field][mine], strict=True)]
        want = want.astype(got[field].dtype)
        value = want.copy()
        value[theirs] = got[field][mine].reshape(value[theirs].shape)
        assert not oracle.off(whole, field, value, want).any(), field
        assert oracle.off(whole, field, value * 1.003 + (value == 0) * 1e-3, want)[theirs].any(), field
    body = full.body("thing").id
    inertia = turn @ matrix(got["body_iquat"][body])
    inertia = inertia @ np.diag(got["body_inertia"][body].astype(float)) @ inertia.T
    xx, yy, zz, xy, xz, yz, *first, mass = c.crb[whole.body("thing").id]
    composite = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    rounding = oracle.FOLLOWING * oracle.EPS
    np.testing.assert_allclose(got["body_mass"][body], mass, rtol=rounding)
    np.testing.assert_allclose(inertia, composite, rtol=0, atol=rounding * np.linalg.norm(composite))
    centre = c.subtree_com[whole.body("thing").id]
    np.testing.assert_allclose(first, 0, atol=1e-12)
    np.testing.assert_allclose(origin + turn @ got["body_ipos"][body], centre, rtol=0, atol=rounding)
    dofs = [model.joint("thing_joint0").dofadr[0] + np.arange(6) for model in (full, whole)]
    for field in ("dof_invweight0", "dof_damping", "dof_armature", "dof_frictionloss"):
        want = getattr(whole, field)
        value = want.copy()
        value[dofs[1]] = got[field][dofs[0]]
        assert not oracle.off(whole, field, value, want).any(), field


FIELDS = (
    *("geom_type", "geom_contype", "geom_conaffinity", "geom_condim", "geom_priority", "geom_group", "geom_solmix"),
    *("geom_solref", "geom_solimp", "geom_size", "geom_rbound", "geom_aabb", "geom_pos", "geom_quat", "geom_friction"),
    *("geom_margin", "geom_gap", "geom_rgba"),
)
"""Of geoms, but for numbers of other elements."""


def matrix(quat):
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, quat.astype(float))
    return found.reshape(3, 3)


def quat_of(mat):
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, mat.reshape(-1))
    return found


def same_side(quat, other):
    """Of the two quaternions of a rotation that which is nearer to another."""
    return quat if quat @ other > 0 else -quat


@functools.cache
def template(arena, impl):
    return arena.put_model(impl)
