"""The model of the nominal arena, and what may differ from it in other worlds (host)."""

import warnings
from collections.abc import Sequence

import jax
import mujoco
import numpy as np
from mujoco import mjx

from mjx_arenas import build, fields, objects, shapes, specs, validation
from mjx_arenas.layout import Layout
from mjx_arenas.params import ArenaParams
from mjx_arenas.parts import Parts

# What C MuJoCo derives from fields that are written, when it is told to, or uses as a short-cut, and the `qpos` of keyframes
# that have none; MJX reads none of it.
DERIVED_IN_C = frozenset({"bvh_aabb", "bvh_child", "bvh_nodeid", "dof_length", "geom_sameframe", "key_qpos"})


def warn_of_nominal_places(
    model: mujoco.MjModel, parts: Parts, table_there: np.ndarray, object_there: np.ndarray
) -> None:
    """Warns of objects that start inside something, at the arena's nominal places, of what is there."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = {o.name for o in parts.objects}
    absent = set(build.absent_names(parts, table_there, object_there))
    for contact in data.contact:
        roots = [model.body(model.body_rootid[model.geom_bodyid[g]]).name for g in contact.geom]
        if contact.dist < -1e-3 and not names.isdisjoint(roots) and absent.isdisjoint(roots) and roots[0] != roots[1]:
            a, b = (
                repr(root) if root in names else specs.geom_name(model, g)
                for root, g in zip(roots, contact.geom, strict=True)
            )
            depth = f"{-contact.dist:.3f} m inside each other"
            warnings.warn(
                f"{a} and {b} start {depth} at their nominal places; `make_data` with keys draws free ones.",
                stacklevel=5,
            )
            return


STATISTICS = ("center", "extent", "meansize", "meanmass", "meaninertia")


def compiled(
    spec: mujoco.MjSpec, parts: Parts, nominal: ArenaParams, maker: str
) -> tuple[mujoco.MjModel, frozenset[str]]:
    """The nominal model, and what may differ in other worlds: no more than this library writes.

    Args:
        spec: of the nominal arena, with whatever was added to it.
        parts: of the arena.
        nominal: its parameters.
        maker: name of the arena's class.

    Raises:
        ValueError: the parameters would not decide the arena alone.
    """
    if spec.compiler.fusestatic or spec.compiler.discardvisual:
        raise ValueError(
            "`spec.compiler`: fusestatic and discardvisual would remove parts of the tables: switch them off."
        )
    rules = specs.mass_rules(spec) if parts.objects else []
    if rules:
        raise ValueError(
            f"`spec.compiler`: {', '.join(rules)} would change the masses of objects, which parameters decide: switch them off, "
            f"and give the bodies of the MJCF that they are for an <inertial>."
        )
    validation.raise_all(objects.addition_problems(spec, parts.objects), "`arena.spec`")
    try:
        model = spec.compile()
        again, other = spec.copy(), spec.copy()
        build.set_params(again, parts, nominal)
        build.set_params(other, parts, elsewhere(nominal, parts.places.kind))
        edited = differing(model, again.compile())
        varying = differing(model, other.compile())
    except ValueError as error:
        raise ValueError(f"MuJoCo cannot compile the arena: {specs.one_line(error)}") from None
    if edited:
        raise ValueError(
            f"`arena.spec`: {', '.join(sorted(edited))} of a table or object was edited, which parameters decide: "
            f"give it as an argument of {maker} or Object."
        )
    foreign = varying - fields.FIELDS.keys() - DERIVED_IN_C
    if foreign:
        raise ValueError(
            f"MuJoCo derives {', '.join(sorted(foreign))} from where tables and objects stand, which would be stale in other worlds: "
            f"give equalities and tendons explicit numbers (relpose, springlength), or keep them off these."
        )
    for i in np.flatnonzero(model.tendon_armature):
        layout = Layout.of(model, parts, frozenset(varying))
        if len({int(layout.owner["body"][b]) for b in layout.tendon_bodies[i]}) > 1:
            raise ValueError(
                f"`arena.spec`: the armature of tendon {model.tendon(i).name!r}, which ends where a table or an object stands, would make "
                f"inverse weights stale in other worlds: leave it at 0."
            )
    pinned = {f"stat.{name}" for name in STATISTICS if not np.isnan(getattr(spec.stat, name)).any()}
    always = fields.ALWAYS - pinned - (set() if parts.objects else {"dof_armature"})
    always -= set() if model.npair else {"pair_margin"}
    always -= set() if (model.geom_matid >= 0).any() else {"geom_matid"}
    if any(model.body(table.body).subtreemass[0] > 0 for table in parts.tables):
        always |= {"body_mass", "body_inertia", "body_subtreemass"}  # as a table may be absent
    return model, frozenset((varying & fields.FIELDS.keys()) | always)


def differing(a: mujoco.MjModel, b: mujoco.MjModel) -> set[str]:
    """Names of the numbers in which two compiled models differ, `stat.` for those of the statistics."""
    found = {f"stat.{name}" for name in STATISTICS if not _same(a.stat, b.stat, name)}
    for name in dir(a):
        if (
            not name.startswith("_")
            and isinstance(getattr(a, name), np.ndarray)
            and getattr(a, name).dtype.kind in "fiu"
        ):
            found |= set() if _same(a, b, name) else {name}
    return found


def _same(a: object, b: object, name: str) -> bool:
    return np.allclose(getattr(a, name), getattr(b, name), rtol=1e-9, atol=1e-12, equal_nan=True)


def elsewhere(params: ArenaParams, kinds: np.ndarray) -> ArenaParams:
    """Another world, in which every parameter of every table and object is another, and all tables may have legs.

    Each changes by numbers of its own: what follows from the difference of two would stay, if they changed alike.
    """
    table, thing = (1 + 0.37 * np.sqrt(np.arange(2, 2 + n)) for n in (len(params.table_rots), len(kinds)))
    sizes = params.table_full_sizes * (1 + 0.1 * table[:, None] * np.array([1.0, 1.3, 0.7]))
    offsets = params.table_offsets + table[:, None] * np.array([0.11, 0.07, 0.05])
    offsets[:, 2] = np.maximum(offsets[:, 2], sizes[:, 2])
    grow = np.where(np.isin(kinds, shapes.PRIMITIVES), 1 + 0.1 * thing, 1.0)[:, None]
    return params._replace(
        table_offsets=offsets,
        table_rots=params.table_rots + 0.3 * table,
        table_full_sizes=sizes,
        table_frictions=params.table_frictions * 1.1 + 0.01,
        has_legs=~params.has_legs,
        object_full_sizes=params.object_full_sizes * grow,
        object_masses=params.object_masses * (1 + 0.3 * thing),
        object_frictions=params.object_frictions * 1.1 + 0.01,
        object_rgba=params.object_rgba * 0.9,
        object_tables=(params.object_tables + 1) % len(offsets),
    )


def of_another_world(model: mjx.Model, layout: Layout, there: np.ndarray, written: Sequence[str]) -> str:
    """Names of the fields of a template, of those that are not written, that are not nominal where parameters decide them.

    Args:
        model: for MJX; not of traced numbers, of which nothing is said.
        layout: of the arena.
        there: (T + K,) bool, the tables and objects that nominally are: others are moved away.
        written: names of fields.
    """
    slabs, own = layout.table_geom[:, 0], layout.primitive_geom
    rows = {"body_pos": layout.table_body, "body_quat": layout.table_body, "geom_size": np.concatenate([slabs, own])}
    rows |= {"geom_friction": slabs, "body_mass": layout.object_body}
    found = []
    for name, ids in rows.items():
        value = getattr(model, name)
        ids = ids[there[layout.owner[name.partition("_")[0]][ids]]]
        if name in written or isinstance(value, jax.core.Tracer):
            continue
        if not np.allclose(np.asarray(value)[ids], getattr(layout.nominal, name)[ids], rtol=1e-5, atol=1e-6):
            found.append(name)
    return ", ".join(found)
