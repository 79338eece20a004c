"""Objects with variants: in each world one of them, and the world is that which has this one alone."""

import functools
import operator
import pathlib
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import oracle
import pytest
import worlds
from idle import Idle
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas.sim import culling

pytestmark = pytest.mark.filterwarnings("ignore:`ranges.object_full_sizes` does not change 'thing'")

DATA = pathlib.Path(__file__).parent / "data"
JUG = """<mujoco><asset><mesh name="wedge" file="{wedge}" scale=".6 .6 .6"/><material name="clay" rgba=".7 .4 .3 1"/></asset><worldbody>
<body name="jug" pos="0 0 .02" euler="0 0 30"><geom name="belly" type="box" size=".03 .02 .04" density="800"/>
<body name="spout" pos=".03 0 .03" euler="0 40 0"><geom type="capsule" size=".008 .02" material="clay"/>
<geom type="mesh" mesh="wedge" pos="0 0 .01" contype="0" conaffinity="0" density="500"/></body></body></worldbody></mujoco>"""
"""Two bodies that nothing moves against each other, and a mesh."""

VARIANTS = (
    mja.Object("brick", "box", (0.1, 0.05, 0.04), mass=0.3, rgba=(0.8, 0.2, 0.1, 1)),
    mja.Object("wedge", "mesh", file=DATA / "wedge.obj", friction=(0.6, 0.01, 0.0002)),
    mja.Object("ball", "sphere", 0.07, density=400),
    mja.Object("rod", "capsule", (0.12, 0.03, 0.03), condim=4),
)
N = len(VARIANTS)


def table(*variants, **kwargs):
    """A table with an object of these variants, beside a cube and a second such object."""
    objects = [mja.Object("thing", variants=list(variants)), mja.Object("cube")]
    return mja.TableArena(objects=objects, **kwargs)


@functools.cache
def scene():
    """Two tables; both objects with variants, which another stands beside."""
    objects = [
        mja.Object("thing", variants=list(VARIANTS), pos=(0.1, 0.1), rot=0.4),
        mja.Object("cube"),
        mja.Object("other", variants=[VARIANTS[2], VARIANTS[1]], on=1),
    ]
    return mja.MultiTableArena([[0, 0, 0.8], [1.4, 0, 0.7]], objects=objects, table_priority=0)


RANGES = mja.ArenaRanges(
    table_offsets=mja.Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    table_rots=mja.Uniform(-3, 3),
    object_full_sizes=mja.Uniform(0.8, 1.2, relative="scale", tied="axes"),
    object_densities=mja.LogUniform(0.5, 2.0, relative="scale"),
    object_frictions=mja.Uniform(0.8, 1.2, relative="scale"),
    object_rgba=mja.Uniform(0.5, 1.0, relative="scale"),
    object_tables=mja.Choice([0, 1]),
    object_active=mja.Bernoulli(0.8),
    terms={"thing.variant": mja.Choice([0, 1, 2, 3]), "other.variant": mja.Choice([0, 1])},
)
CHOICE = mja.ArenaRanges(terms={"thing.variant": mja.Choice([0, 1, 2, 3])})


def alone(arena, which):
    """The arena in which each object with variants is that one variant, which no code for variants has seen."""
    objects = []
    for obj in arena.objects:
        if obj.variants is not None:
            one = obj.variants[which[obj.name]]
            own = {
                f: getattr(one, f)
                for f in ("type", "full_size", "density", "mass", "friction", "condim", "rgba", "file")
            }
            colour = mja.Object("x", rgba=own["rgba"] or tuple(obj_rgba(arena, obj, which[obj.name]))).rgba
            obj = mja.Object(obj.name, on=obj.on, pos=obj.pos, rot=obj.rot, **own | {"rgba": colour})
        objects.append(obj)
    return mja.MultiTableArena(arena.table_offsets, objects=objects, table_priority=0)


def obj_rgba(arena, obj, v):
    (one,) = (x for x in arena.layout.places.variants if x.names == tuple(o.name for o in obj.variants))
    return one.rgba[v]


@functools.cache
def alone_of_scene(thing, other):
    return alone(scene(), {"thing": thing, "other": other})


def params_alone(arena, params):
    """The same parameters for an arena without variants."""
    return jax.tree.map(np.asarray, params)._replace(terms={})


def off_from_compiled(arena, model, compiled, original):
    """Names of the fields of a world's model that are not as compiled, each geom by its name in `original`'s terms."""
    full, got, found, compared = arena.mj_model, worlds.leaves(model), set(), 0
    accessor = {"body": "body", "geom": "geom", "site": "site", "jnt": "joint", "cam": "camera", "light": "light"}
    counts = {"body": "nbody", "geom": "ngeom", "site": "nsite", "jnt": "njnt", "cam": "ncam", "light": "nlight"}
    for field, value in got.items():
        want, kind = getattr(compiled, field, None), field.partition("_")[0]
        if field.startswith("stat."):
            want = np.asarray(getattr(compiled.stat, field[5:]))
        if field == "stat.meaninertia":  # MJX multiplies it by the `nv` of the template
            value = value * full.nv / compiled.nv
        if field in oracle.STRUCTURE_MAY_DIFFER or not isinstance(want, np.ndarray) or want.dtype.kind != "f":
            continue
        if kind in accessor:
            names = [getattr(compiled, accessor[kind])(i).name for i in range(getattr(compiled, counts[kind]))]
            value = value[[getattr(full, accessor[kind])(original.get(name, name)).id for name in names]]
        elif kind == "dof" or field in ("qpos0", "qpos_spring"):
            rows = [full.joint(compiled.joint(j).name) for j in range(compiled.njnt)]
            value = value[
                np.concatenate(
                    [(r.dofadr if kind == "dof" else r.qposadr)[0] + np.arange(6 + (kind != "dof")) for r in rows]
                )
            ]
        if value.shape != want.shape:
            continue
        compared += 1
        if oracle.off(compiled, field, value, want.astype(value.dtype)).any():
            found.add(field)
    assert compared > 40
    return found


def names_alone(arena, which):
    """Of each geom of the arena with one variant alone its name among several."""
    return {f"{name}_g0": f"{name}_{variant}_g0" for name, variant in which.items()}


@functools.cache
def drawn(impl, n=12):
    arena = scene()
    model = arena.put_model(impl)
    return model, arena.randomize(model, mja.world_keys(5, range(n)), RANGES)


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_worlds_are_those_of_one_variant_alone(impl):
    """Every field of random worlds is the compiler's for an arena in which the object is that variant and nothing else."""
    arena, (model, batch) = scene(), drawn(impl)
    assert batch.valid.all()
    seen = set()
    for i in range(12):
        params = batch.world(i)
        v = {name: int(params.terms[f"{name}.variant"][0]) for name in ("thing", "other")}
        names = {"thing": VARIANTS[v["thing"]].name, "other": ("ball", "wedge")[v["other"]]}
        seen.add(v["thing"])
        one = model.tree_replace({name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields})
        # What has one variant alone has the slabs' `condim` of that variant alone.
        compiled = alone_of_scene(**v).compile(params_alone(arena, params))
        original = names_alone(arena, names)
        assert off_from_compiled(arena, one, compiled, original) == set()
        assert off_from_compiled(arena, one, arena.compile(params), {}) == set()
    assert seen == set(range(N))


@pytest.mark.parametrize(
    "stale", ["body_ipos", "body_inertia", "body_iquat", "body_mass", "qpos0", "stat.meansize", "geom_friction"]
)
def test_oracle_notices(stale):
    """What a variant alone decides, if it were nominal."""
    arena = scene()
    model = arena.put_model("jax")
    params = arena.with_variants(arena.nominal_params(), thing="wedge")
    fields = arena.fields(model, params)
    assert off_from_compiled(arena, model.tree_replace(fields), arena.compile(params), {}) == set()
    del fields[stale]
    assert off_from_compiled(arena, model.tree_replace(fields), arena.compile(params), {}) == {stale}


@functools.cache
def one_table(can=True):
    """All kinds of variants that an implementation collides with boxes."""
    can = [mja.Object("can", "cylinder", (0.07, 0.07, 0.1))] if can else []
    return mja.TableArena(objects=[mja.Object("thing", variants=[*VARIANTS, *can])])


def of_each(arena):
    """(V, ...) nominal parameters with each of the variants."""
    nominal, n = arena.nominal_params(), len(arena.objects[0].variants)
    return jax.tree.map(lambda *x: np.stack(x), *(arena.with_variants(nominal, thing=v) for v in range(n)))


DROPPED = [
    ("warp", "all"),
    *(pytest.param(*row, marks=pytest.mark.xslow) for row in (("warp", "round"), ("jax", "all"))),
]


@pytest.mark.slow
@pytest.mark.parametrize(("impl", "kinds"), DROPPED, indirect=["impl"])
def test_rest_heights(impl, kinds):
    """Dropped, each lies as high as in C MuJoCo with this variant alone, and as `rest_heights` says: the others hold nothing up.

    Warp compiles for long what collides where nothing is round.
    """
    things = [mja.Object("thing", variants=list(VARIANTS[2:]))]
    arena = mja.TableArena(objects=things) if kinds == "round" else one_table(impl == "warp")
    params = of_each(arena)
    batch = arena.batch(arena.put_model(impl), params)
    assert batch.valid.all()
    data = mja.make_data(batch)
    z = arena.layout.object_qpos[0, 2]
    data = mja.rollout(batch, data.replace(qpos=data.qpos.at[:, z].add(0.004)), 150)
    reference = []
    for obj in arena.objects[0].variants:
        own = {f: getattr(obj, f) for f in ("type", "full_size", "density", "mass", "friction", "condim", "file")}
        alone = mja.TableArena(objects=[mja.Object("thing", **own)], table_condim=4)  # as where the rod may be there
        model, c = alone.c_world(alone.nominal_params())
        c.qpos[2] += 0.004
        mujoco.mj_step(model, c, 150)
        reference.append(c.qpos[2])
    np.testing.assert_allclose(data.qpos[:, z], reference, rtol=0, atol=1e-4)
    np.testing.assert_allclose(jax.vmap(arena.rest_heights)(params)[:, 0], reference, rtol=0, atol=1e-3)
    assert np.ptp(reference) > 0.01


@pytest.mark.slow
def test_numbers_are_the_variants():
    """What is drawn is drawn from the variant's own numbers, whichever it is: relative to these, or for whichever."""
    arena = scene()
    batch = drawn("jax")[1]
    (thing, other), p = arena.layout.places.variants, batch.params
    for one, k in ((thing, 0), (other, 2)):
        v = np.asarray(p.terms[one.quantity])[:, 0].astype(int)
        np.testing.assert_allclose(p.object_full_sizes[:, k], one.full_size[v], rtol=1e-6)
        assert np.ptp(np.asarray(p.object_masses[:, k]) / one.mass[v]) > 0.1
        for got, own, low, high in (
            (p.object_masses[:, k], one.mass[v], 0.5, 2.0),
            (p.object_frictions[:, k], one.friction[v], 0.8, 1.2),
            (p.object_rgba[:, k], one.rgba[v], 0.5, 1.0),
        ):
            share = np.asarray(got)[own > 0] / own[own > 0]
            assert ((share >= low * (1 - 1e-6)) & (share <= high * (1 + 1e-6))).all()
    given = arena.randomize(
        arena.put_model("jax"), mja.world_keys(5, range(4)), CHOICE._replace(object_masses=mja.Fixed(0.5))
    )
    np.testing.assert_allclose(given.params.object_masses, 0.5)
    assert len(np.unique(given.params.terms["thing.variant"])) > 1


def test_drawn_by_probability():
    """Each as often as its probability says, whatever else there is."""
    arena, p = scene(), (0.5, 0.3, 0.2)
    ranges = mja.ArenaRanges(terms={"thing.variant": mja.Choice([0, 3, 1], p=p)})
    keys = mja.world_keys(0, range(2048))
    draw = jax.jit(jax.vmap(lambda key: arena.sample_params(key, ranges)))
    chosen = np.asarray(draw(keys).terms["thing.variant"])[:, 0]
    for v, share in zip((0, 3, 1), p, strict=True):
        assert abs((chosen == v).mean() - share) < 4 * np.sqrt(share * (1 - share) / 2048)
    more = ranges._replace(table_rots=mja.Uniform(-1, 1), terms={**ranges.terms, "other.variant": mja.Choice([0, 1])})
    again = jax.vmap(lambda key: arena.sample_params(key, more))(keys[:16])
    np.testing.assert_array_equal(again.terms["thing.variant"][:, 0], chosen[:16])


def test_coded():
    """A world is a point of the unit cube, the way back gives it, and its density is the choice's probability."""
    arena, p = scene(), np.array([0.5, 0.3, 0.2])
    ranges = mja.ArenaRanges(
        object_frictions=mja.Uniform(0.8, 1.2, relative="scale", tied="axes"),
        object_masses=mja.LogUniform(0.5, 2.0, relative="scale"),
        terms={"thing.variant": mja.Choice([0, 3, 1], p=p), "other.variant": mja.Fixed(1)},
    )
    for key in mja.world_keys(1, range(4)):
        params = arena.sample_params(key, ranges)
        vector = arena.encode(params, ranges)
        again = arena.decode(vector, ranges)
        for a, b in zip(jax.tree.leaves(again), jax.tree.leaves(params), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-5)
        share = p[[0, 3, 1].index(int(params.terms["thing.variant"][0]))]
        mass = np.asarray(params.object_masses)
        own = np.array([x.friction[int(params.terms[x.quantity][0])][0] for x in arena.layout.places.variants])
        widths = 0.4 * np.array([own[0], 1.0, own[1]])
        expected = np.log(share) - np.log(widths).sum() - np.log(mass * np.log(4.0)).sum()
        np.testing.assert_allclose(arena.log_prob(params, ranges), expected, rtol=1e-4)
        other = arena.with_variants(params, thing=2)._replace(object_frictions=params.object_frictions)
        assert arena.log_prob(other, ranges) == -np.inf


@pytest.mark.slow
def test_placed():
    """Objects stand clear of each other by the outlines of their variants, at their heights."""
    arena = mja.TableArena((0.5, 0.5, 0.05), objects=[mja.Object(f"o{i}", variants=list(VARIANTS)) for i in range(8)])
    ranges = mja.ArenaRanges(terms={f"o{i}.variant": mja.Choice([0, 1, 2, 3]) for i in range(8)})
    keys = mja.world_keys(2, range(16))
    batch = arena.randomize(arena.put_model("jax"), keys, ranges)
    places = jax.vmap(arena.place)(batch.params, keys)
    assert np.asarray(places.valid).mean() > 0.9
    for i in np.flatnonzero(np.asarray(places.valid).all(1))[:6]:
        model, c = arena.c_world(batch.world(i), key=keys[i])
        between = [
            x.dist for x in c.contact if model.geom_bodyid[x.geom1] and model.body_dofnum[model.geom_bodyid[x.geom1]]
        ]
        assert not [d for d in between if d < -1e-4]
        lowest = min(x.dist for x in c.contact)
        assert -1e-4 < lowest < 1e-3
        assert model.ngeom == arena.mj_model.ngeom - 8 * (N - 1)


def jug(tmp_path):
    """The path of an MJCF of two bodies."""
    path = tmp_path / "jug.xml"
    path.write_text(JUG.format(wedge=DATA / "wedge.obj"))
    return path


def test_mjcf(tmp_path):
    """The bodies of a file become one: it weighs, looks and lies as the file alone, step by step."""
    jugs = [
        mja.Object("jug", "mjcf", file=jug(tmp_path), **more)
        for more in ({}, {"mass": 0.5, "friction": (0.4, 0.01, 0.001)})
    ]
    for one in jugs:
        arena = mja.TableArena(objects=[mja.Object("thing", variants=[VARIANTS[1], one]), mja.Object("cube")])
        whole = mja.TableArena(
            objects=[
                mja.Object("thing", "mjcf", file=one.file, mass=one.mass, friction=one.friction),
                mja.Object("cube"),
            ]
        )
        params = arena.with_variants(arena.nominal_params(), thing="jug")
        assert not arena.problems(params)
        (model, c), (other, d) = arena.c_world(params), whole.c_world(whole.nominal_params())
        assert model.nbody == other.nbody - 2
        np.testing.assert_allclose(model.body("thing").mass, other.body("thing").subtreemass, rtol=1e-12)
        for _ in range(150):
            mujoco.mj_step(model, c)
            mujoco.mj_step(other, d)
        np.testing.assert_allclose(c.qpos, d.qpos, rtol=0, atol=1e-4)  # the two compute alike, and not in one order
        mine, theirs = (
            [g for g in range(m.ngeom) if m.body(m.body_rootid[m.geom_bodyid[g]]).name == "thing"]
            for m in (model, other)
        )
        np.testing.assert_allclose(c.geom_xpos[mine], d.geom_xpos[theirs], rtol=0, atol=1e-4)
        np.testing.assert_allclose(model.geom_rgba[mine], other.geom_rgba[theirs])
        np.testing.assert_array_equal(model.geom_friction[mine][:2], other.geom_friction[theirs][:2])


ODD = """<mujoco><worldbody><body><geom name="g" type="box" size=".05 .06 .07" condim="4" priority="2" solmix="2" solref=".01 .9"
solimp=".8 .9 .002 .4 3" margin=".01" gap=".005" fluidshape="ellipsoid" fluidcoef="1 2 3 4 5" {}/></body></worldbody></mujoco>"""
NEW = {"surfacevel": ".1 .2 .3 .4 .5 .6", "adhesion": "3", "castshadow": "false"}  # of MuJoCo 3.17 and 4
NEWER = " ".join(f'{name}="{value}"' for name, value in NEW.items() if hasattr(mujoco.MjsGeom, name))


def test_odd_geoms_of_mjcf(tmp_path):
    """A geom of a variant's file has all that it has in the file alone."""
    (tmp_path / "odd.xml").write_text(ODD.format(NEWER))
    file = {"file": tmp_path / "odd.xml"}
    variant = mja.TableArena(objects=[mja.Object("thing", variants=[mja.Object("odd", "mjcf", **file), VARIANTS[1]])])
    alone = mja.TableArena(objects=[mja.Object("thing", "mjcf", **file)])
    models = [arena.compile(arena.nominal_params()) for arena in (variant, alone)]
    ids = [model.body("thing").geomadr[0] for model in models]
    names = {n for n in dir(models[0]) if n.startswith("geom_") and len(getattr(models[0], n)) == models[0].ngeom}
    assert len(names) > 25
    one, two = (
        {n: np.array(getattr(m, n)[g]) for n in names - {"geom_user", "geom_bodyid"}}
        for m, g in zip(models, ids, strict=True)
    )
    assert {n for n in one if not np.array_equal(one[n], two[n])} == set()


@pytest.mark.slow
def test_mjcf_is_written_as_compiled(tmp_path, impl):
    """A file of several geoms, one of which collides with nothing, beside others, in colours of its own."""
    variants = [mja.Object("jug", "mjcf", file=jug(tmp_path)), VARIANTS[0], VARIANTS[2]]
    arena = mja.TableArena(objects=[mja.Object("thing", variants=variants)])
    ranges = mja.ArenaRanges(
        object_masses=mja.LogUniform(0.5, 2.0, relative="scale"),
        object_rgba=mja.Uniform(0.5, 1.0, relative="scale"),
        terms={"thing.variant": mja.Choice([0, 1, 2])},
    )
    model = arena.put_model(impl)
    for i in range(3):
        params = arena.with_variants(arena.sample_params(mja.world_keys(0, [i])[0], ranges), thing=i)
        params = params._replace(object_rgba=params.object_rgba * 0.7, object_masses=params.object_masses * 1.3)
        assert off_from_compiled(arena, arena.apply(model, params), arena.compile(params), {}) == set()


def test_files(tmp_path):
    """YAML holds variants, with paths beside it; the MJCF of a world has the geoms of one variant."""
    arena = mja.TableArena(
        objects=[mja.Object("thing", variants=[*VARIANTS[:3], mja.Object("jug", "mjcf", file=jug(tmp_path))])]
    )
    mja.save(tmp_path / "mugs.yaml", arena, CHOICE)
    again, ranges = mja.load(tmp_path / "mugs.yaml")
    assert ranges == CHOICE
    assert again.record == arena.record
    assert [v.name for v in again.objects[0].variants] == ["brick", "wedge", "ball", "jug"]
    params = arena.with_variants(arena.nominal_params(), thing="wedge")
    found = mujoco.MjModel.from_xml_string(arena.to_xml(params))
    compiled = arena.compile(params)
    assert "thing_wedge_g0" in arena.to_xml(params)
    assert "thing_brick_g0" not in arena.to_xml(params)
    for name in ("body_mass", "body_inertia", "body_ipos", "geom_pos", "geom_rbound"):
        np.testing.assert_allclose(getattr(found, name), getattr(compiled, name), rtol=1e-6, atol=1e-12)
    arena.export(params, tmp_path / "world")
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "world" / "world.xml")).ngeom == compiled.ngeom
    text = (tmp_path / "mugs.yaml").read_text().replace("name: ball", "name: wedge")
    (tmp_path / "twice.yaml").write_text(text)
    with pytest.raises(ValueError, match=r"twice.yaml:\d+: .*two variants are named 'wedge'"):
        mja.load(tmp_path / "twice.yaml")


def test_told():
    """`describe` says which variant is there; rendered, its colour is seen, and no other's."""
    arena = one_table(False)
    params = arena.with_variants(arena.nominal_params(), thing="wedge")
    text = str(arena.describe(params))
    assert "mesh (wedge)" in text
    assert "thing.variant  thing  1" in text
    stacked = of_each(arena)
    assert "thing.variant" in str(arena.describe(stacked))
    assert len(arena.c_world(params)[1].geom_xpos) == arena.mj_model.ngeom - N + 1
    model = arena.apply(arena.put_model("jax"), params)
    slots = [arena.mj_model.geom(f"thing_{v.name}_g0").id for v in VARIANTS]
    np.testing.assert_array_equal(np.asarray(model.geom_rgba)[slots, 3] > 0, [False, True, False, False])
    np.testing.assert_array_equal(np.asarray(model.geom_margin)[slots] < 0, [True, False, True, True])


@pytest.mark.slow
@pytest.mark.xslow_on("jax")
@pytest.mark.parametrize("engine", ["jax", "c"])
def test_checked(engine):
    """What is not there is in tables, and no penetration: `check` finds nothing wrong, on MJX and in C."""
    flat = mja.Object("flat", "box", (0.1, 0.1, 0.01))
    arena = mja.TableArena(objects=[mja.Object("thing", variants=[flat, *VARIANTS[2:]])])
    ranges = mja.ArenaRanges(terms={"thing.variant": mja.Choice([0, 1, 2])})
    found = mja.check(arena, ranges, n_worlds=8, n_steps=10, engine=engine)
    assert found.ok, str(found)


def test_merged():
    """The objects of another arena keep their variants, under its prefix."""
    one, other = (
        one_table(False),
        mja.TableArena(objects=[mja.Object("cube"), mja.Object("thing", variants=list(VARIANTS[1:3]))]),
    )
    both = one.merge(other, "b_", (2, 0, 0))
    assert both.quantities == ("thing.variant", "b_thing.variant")
    params = both.with_variants(both.nominal_params(), thing="ball", b_thing="ball")
    assert not both.problems(params)
    assert off_from_compiled(both, both.apply(both.put_model("jax"), params), both.compile(params), {}) == set()
    height = np.asarray(both.rest_heights(params))
    np.testing.assert_allclose(height[[0, 2]], 0.8 + 0.035, rtol=1e-6)


@pytest.mark.slow
def test_on_furniture():
    """Added to a part of furniture, each lies on it, and the world is the compiled one."""
    arena = mja.TableArena(objects=[mja.Object("other", variants=list(VARIANTS[:2]))])
    arena.add_part(mja.furniture.Shelf("rack", pos=(1.5, 0, 0), heights=(0.3, 0.8)))
    arena.add_object(mja.Object("thing", variants=list(VARIANTS), on="rack_board1"))
    params = arena.with_variants(arena.nominal_params(), thing="ball", other="wedge")
    assert arena.problems(params) == []
    np.testing.assert_allclose(arena.rest_heights(params)[1], 0.8 + 0.035, rtol=1e-6)
    assert off_from_compiled(arena, arena.apply(arena.put_model("jax"), params), arena.compile(params), {}) == set()
    assert mja.check(
        arena, mja.ArenaRanges(terms={"thing.variant": mja.Choice([0, 1, 2])}), n_worlds=4, n_steps=10, engine="c"
    ).ok


def test_room():
    """Ten variants have room for the contacts of the one that has most, not of all."""
    ten = [mja.Object(f"v{i}", "box", 0.04 + 0.01 * i) for i in range(10)]
    rooms = [
        mja.TableArena(objects=[mja.Object(f"o{k}", variants=ten[:n]) for k in range(2)]).record.room(None)
        for n in (1, 10)
    ]
    plain = mja.TableArena(objects=[mja.Object(f"o{k}") for k in range(2)]).record.room(None)
    assert rooms[0] == rooms[1] == plain


def test_trainers_take_them():
    """`randomization_fn` gives worlds with a variant each."""
    arena = one_table(False)
    model, axes = arena.randomization_fn(CHOICE)(arena.put_model("jax"), mja.world_keys(0, range(16)))
    slots = [arena.mj_model.geom(f"thing_{v.name}_g0").id for v in VARIANTS]
    there = np.asarray(model.geom_margin)[:, slots] > -1
    np.testing.assert_array_equal(there.sum(1), 1)
    assert there.any(0).all()
    assert axes.body_ipos == 0


def test_in_cs_batch():
    """Thrown, each moves as in the world compiled with it alone."""
    arena = one_table()
    params = of_each(arena)
    batch = arena.c_batch(params)
    start = np.array(batch.qpos)
    start[:, 2] += 0.03
    start[:, 3:] = np.array([0.9, 0.3, 0.2, 0.1]) / np.linalg.norm([0.9, 0.3, 0.2, 0.1])
    batch.qpos = start
    got = batch.rollout(150)["qpos"]
    for i in range(N + 1):
        model, c = arena.c_world(worlds.take(params, i))
        c.qpos = start[i]
        mujoco.mj_step(model, c, 150)
        np.testing.assert_allclose(got[i, -1], c.qpos, rtol=0, atol=2e-6)


@pytest.mark.xslow
def test_pictures():
    """Pixel by pixel those of the arena with one variant alone, which segmentation calls by the object's name."""
    arena = one_table()
    batch = arena.batch(arena.put_model("warp"), of_each(arena))

    def drawn(arena, batch):
        drawing = arena.renderer({"frontview": (96, 72)}, depth=True, segmentation=True)
        seen = drawing(batch, mja.make_data(batch))["frontview"]
        return seen, np.asarray(seen.segmentation) == drawing.labels.index("thing")

    seen, here = drawn(arena, batch)
    colours = arena.layout.places.variants[0].rgba
    for i, one in enumerate(arena.objects[0].variants):
        own = {f: getattr(one, f) for f in ("type", "full_size", "file")}
        alone = mja.TableArena(objects=[mja.Object("thing", rgba=colours[i], **own)])
        stacked = jax.tree.map(lambda x: x[None], alone.nominal_params())
        other, there = drawn(alone, alone.batch(alone.put_model("warp"), stacked))
        np.testing.assert_array_equal(here[i], there[0])
        assert here[i].sum() > 5
        for name in ("rgb", "depth"):
            got, want = (np.asarray(getattr(x, name), float)[j] for x, j in ((seen, i), (other, 0)))
            np.testing.assert_allclose(got, want, atol=1.01 if name == "rgb" else 1e-4)


@pytest.mark.slow
def test_a_variant_in_each_episode():
    """An environment draws one anew, steps with it, and starts where it rests."""
    balls = [mja.Object("marble", "sphere", 0.03), mja.Object("ball", "sphere", 0.08)]
    arena = mja.TableArena(objects=[mja.Object("thing", variants=balls)])
    arena.spec.option.iterations, arena.spec.option.ls_iterations = 1, 6  # one is no loop, which compiles faster

    ranges = mja.ArenaRanges(terms={"thing.variant": mja.Choice([0, 1])})
    env = Idle(arena, ranges, 0.05, 0.005, 3)
    state = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(0), 8))
    state = jax.jit(jax.vmap(env.step))(state, jnp.zeros((8, env.action_size)))
    params = state.info["episode"].params
    chosen = np.asarray(params.terms["thing.variant"])[:, 0]
    assert set(chosen) == {0, 1}
    np.testing.assert_allclose(state.data.qpos[:, 2], np.where(chosen, 0.84, 0.815), atol=5e-4)


@pytest.mark.xslow
def test_tables_out_of_reach_are_culled():
    """Steps that leave out tables give the same as MJX's own, and keep the contacts of what is there."""
    ball, rod = VARIANTS[2:]  # boxes on boxes compile for long, and are culled alike (test_culling.py)
    marbles = [ball, mja.Object("marble", "sphere", 0.04)]
    things = [mja.Object("thing", variants=[ball, rod], on=1), mja.Object("other", variants=marbles, on=3)]
    arena = mja.MultiTableArena([[1.2 * i, 0, 0.8] for i in range(6)], objects=things)
    arena.spec.option.iterations, arena.spec.option.ls_iterations = 4, 6
    ranges = mja.ArenaRanges(terms={"thing.variant": mja.Choice([0, 1]), "other.variant": mja.Choice([0, 1])})
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(1, range(12)), ranges)
    assert len(np.unique(jnp.hstack(list(batch.params.terms.values())), axis=0)) == 4
    data = mja.make_data(batch)
    z = arena.layout.object_qpos[:, 2]
    data = data.replace(qpos=data.qpos.at[:, z].add(0.002))
    assert culling.plan(batch.model, batch.fields, arena.layout, data) is not None
    expected, step = data, jax.jit(jax.vmap(mjx.step, in_axes=(batch.in_axes, 0)))
    for _ in range(60):
        expected = step(batch.model, expected)
    got = mja.rollout(batch, data, 60)
    np.testing.assert_allclose(got.qpos, expected.qpos, rtol=0, atol=1e-6)
    np.testing.assert_allclose(got.qpos[:, z], jax.vmap(arena.rest_heights)(batch.params), rtol=0, atol=1e-3)


@pytest.mark.slow
def test_documented():
    """The code of docs/variants.md runs."""
    text = (pathlib.Path(__file__).parent.parent / "docs" / "variants.md").read_text()
    (block,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names = {}
    exec(compile(block, "docs/variants.md", "exec"), names)
    assert names["batch"].valid.all()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:'thing' and 'more' start")
def test_failures_are_replayed(tmp_path):
    """A world without room for both is a bundle that shows the same again."""
    wide = [mja.Object("crate", "box", 0.3), mja.Object("globe", "sphere", 0.3)]
    things = [mja.Object(name, variants=wide) for name in ("thing", "more")]
    arena = mja.TableArena((0.5, 0.5, 0.05), objects=things)
    ranges = mja.ArenaRanges(terms={f"{thing.name}.variant": mja.Choice([0, 1]) for thing in things})
    report = mja.check(arena, ranges, n_worlds=2, n_steps=10, engine="c")
    assert report.failed.all()
    for world in range(2):
        report.save_bundle(tmp_path / str(world), world)
        assert "the same failure shows" in str(mja.replay(tmp_path / str(world)))
