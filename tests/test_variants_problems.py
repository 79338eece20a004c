"""Wrong uses of variants: each is answered by one sentence that says what may be."""

import pathlib
import re

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.build import vary

DATA = pathlib.Path(__file__).parent / "data"
Object = mja.Object
MUG, CAN = Object("mug"), Object("can", "cylinder", (0.05, 0.05, 0.1))


def table(*objects):
    return mja.TableArena(objects=list(objects))


def thing(*variants, **whole):
    return Object("thing", variants=list(variants), **whole)


def file_of(text):
    return mujoco.MjSpec.from_string(f"<mujoco><worldbody><body>{text}</body></worldbody></mujoco>")


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (
            lambda: [thing()],
            "Object 'thing': `variants` must be a list of at least one mjx_arenas.Object, each a variant, got [].",
        ),
        (
            lambda: [Object("thing", variants="mug")],
            "Object 'thing': `variants` must be a list of at least one mjx_arenas.Object, each a variant, got 'mug'.",
        ),
        (lambda: [thing("mug")], "Object 'thing': `variants[0]` must be an mjx_arenas.Object, got 'mug'."),
        (
            lambda: [thing(MUG, Object("mug", "sphere"))],
            "Object 'thing': `variants[1].name`: two variants are named 'mug': names must differ.",
        ),
        (
            lambda: [thing(Object("a", variants=[MUG]))],
            "Object 'thing': `variants[0].variants` must be None, as a variant has no variants.",
        ),
        (
            lambda: [thing(Object("a", pos=(0, 0)))],
            (
                "Object 'thing': `variants[0].pos` is the same for all variants, got (0, 0): give it to the object that has "
                "the variants."
            ),
        ),
        (
            lambda: [thing(Object("a", active=False))],
            (
                "Object 'thing': `variants[0].active` is the same for all variants, got False: give it to the object that has "
                "the variants."
            ),
        ),
        (
            lambda: [thing(MUG, mass=0.2)],
            "Object 'thing': `mass` belongs to each variant, got 0.2: give it to the objects in `variants`.",
        ),
        (
            lambda: [Object("thing", "sphere", variants=[MUG])],
            "Object 'thing': `type` belongs to each variant, got 'sphere': give it to the objects in `variants`.",
        ),
        (
            lambda: [thing(MUG, Object("b", full_size=-1))],
            "Object 'thing': `variants[1].full_size` must be one number or 3 numbers, all > 0 [m], got -1.",
        ),
        (lambda: [thing(MUG, pos=(0, 0, 0))], "Object 'thing': `pos` must be 2 finite numbers, got (0, 0, 0)."),
        (
            lambda: [thing(Object("m", "mesh"))],
            "Object 'thing': `variants[0].file` must be the path of its mesh, got None.",
        ),
        (
            lambda: [thing(MUG, Object("large", full_size=2.0))],
            "Object 'thing_large' is 2 x 2 m, larger than table 0, which is 0.8 x 0.8 m.",
        ),
        (
            lambda: [thing(MUG), Object("thing_mug")],
            "Object 'thing_mug': the arena already has an element of that name.",
        ),
        (
            lambda: [
                thing(
                    Object(
                        "j", "mjcf", file=file_of('<geom size=".1"/><body pos="0 0 1"><joint/><geom size=".1"/></body>')
                    )
                )
            ],
            "Object 'thing_j': its file has 1 joint, but a variant must be one rigid body: remove them.",
        ),
        (
            lambda: [thing(Object("j", "mjcf", file=DATA / "drawer.xml"))],
            (
                "Object 'thing_j': its file has 1 joint, 1 actuator, 1 sensor, but a variant must be one rigid body: remove "
                "them."
            ),
        ),
        (
            lambda: [thing(Object("g", "mjcf", file=file_of('<geom size=".1" contype="0" conaffinity="0"/>')))],
            "Object 'thing_g': none of the geoms in its file collides, so it cannot stand on a table.",
        ),
    ],
)
def test_objects(made, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        table(*made())


@pytest.fixture(scope="module")
def arena():
    return table(thing(MUG, CAN), Object("cube"))


@pytest.mark.parametrize(
    ("dist", "message"),
    [
        (
            mja.Choice([0, 2]),
            "`ranges.terms.thing.variant` of object 'thing' can reach 2.0: it must stay between 0 and 1.",
        ),
        (
            mja.Choice([0, 0.5]),
            "`ranges.terms.thing.variant` of object 'thing' can reach 0.5: it must stay the number of one of its variants: 0 (mug), "
            "1 (can).",
        ),
        (
            mja.Choice(["mug", "can"]),
            "`ranges.terms.thing.variant` (Choice): `values` must be the number of one of its variants: 0 (mug), 1 (can), "
            "got ['mug', 'can'].",
        ),
        (
            mja.Uniform(0, 1),
            "`ranges.terms.thing.variant` (Uniform): indices need Choice or Fixed, which cannot be relative.",
        ),
        (
            mja.Choice([0, 1], p=[0.5, 0.6]),
            "`ranges.terms.thing.variant` (Choice): `p` must be 2 probabilities that add up to 1, got [0.5, 0.6].",
        ),
        (mja.Fixed(5), "`ranges.terms.thing.variant` of object 'thing' can reach 5.0: it must stay between 0 and 1."),
    ],
)
def test_ranges(arena, dist, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        arena.check_ranges(mja.ArenaRanges(terms={"thing.variant": dist}))


def test_unknown_quantity(arena):
    message = "`ranges.terms`: the arena has no quantity 'cube.variant': did you mean `thing.variant`?"
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        arena.check_ranges(mja.ArenaRanges(terms={"cube.variant": mja.Fixed(0)}))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"thing": "cup"}, "`with_variants.thing` must be one of 'mug', 'can', or an index from 0, got 'cup'."),
        ({"thing": 2}, "`with_variants.thing` must be one of 'mug', 'can', or an index from 0, got 2."),
        ({"thing": True}, "`with_variants.thing` must be one of 'mug', 'can', or an index from 0, got True."),
        ({"cube": 0}, "`with_variants.cube`: no object 'cube' has variants; these have: thing."),
    ],
)
def test_with_variants(arena, given, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        arena.with_variants(arena.nominal_params(), **given)


@pytest.mark.parametrize(
    ("numbers", "says"),
    [
        ([1.0], "must be [0.05, 0.05, 0.1], as of its variant 'can', got [0.05"),
        (
            [0.4],
            "`terms.thing.variant` of object 'thing' must be finite and the number of one of its variants: 0 (mug), 1 (can), got 0.4.",
        ),
        (
            [np.nan],
            "`terms.thing.variant` of object 'thing' must be finite and the number of one of its variants: 0 (mug), 1 (can), got nan.",
        ),
        ([-1.0], "`terms.thing.variant` of object 'thing' must be between 0 and 1, got -1.0."),
    ],
)
def test_worlds(arena, numbers, says):
    """The flag and the sentence agree."""
    params = arena.nominal_params()._replace(terms={"thing.variant": np.array(numbers)})
    (found,) = arena.problems(params)
    assert says in found
    assert not jax.jit(arena.valid)(params)
    right = arena.with_variants(params, thing="can")
    assert arena.problems(right) == []
    assert arena.valid(right)


def edited(change):
    arena = table(thing(MUG, CAN))
    change(arena.spec)
    return arena.mj_model


def add_sensor(spec):
    kind, geom = mujoco.mjtSensor.mjSENS_FRAMEPOS, mujoco.mjtObj.mjOBJ_GEOM
    spec.add_sensor(name="eye", type=kind, objtype=geom, objname="thing_can_g0")


def add_tendon(spec):
    rope = spec.add_tendon(name="rope")
    for name, x in (("a", 1), ("b", 2)):
        spec.worldbody.add_site(name=name, pos=[x, 0, 1])
    rope.wrap_site("a")
    rope.wrap_geom("thing_can_g0", "")
    rope.wrap_site("b")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda spec: spec.body("thing").add_geom(name="lid", size=[0.1, 0, 0]),
            (
                "Object 'thing': `arena.spec` adds geom 'lid' to its body. An object with variants may only get sites, cameras "
                "and lights."
            ),
        ),
        (
            lambda spec: spec.delete(spec.geom("thing_can_g0")),
            (
                "`arena.spec`: geom 'thing_can_g0' of a table, an object or a part is gone: do not delete or rename it "
                "(`table_active` and `active` of an object or a part make it absent)."
            ),
        ),
        (
            lambda spec: setattr(spec.geom("thing_can_g0"), "friction", [0.3, 0.1, 0.1]),
            "`arena.spec`: geom_friction of a table or object was edited, which parameters decide: give it as an argument of TableArena or "
            "of Object.",
        ),
        (
            add_sensor,
            "`arena.spec`: sensor 'eye' needs geom 'thing_can_g0', which is of a variant and not there in all worlds: take a site or the "
            "body.",
        ),
        (
            add_tendon,
            "`arena.spec`: a tendon needs geom 'thing_can_g0', which is of a variant and not there in all worlds: take a site or the body.",
        ),
    ],
)
def test_edits(change, message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        edited(change)


def test_pairs_go_with_their_variant():
    """Contacts of an explicit pair are off where its geom is not there, as in the compiled world without it."""
    arena = table(thing(MUG, Object("ball", "sphere")))
    arena.spec.add_pair(name="p", geomname1="thing_ball_g0", geomname2="floor")
    nominal = arena.nominal_params()
    for name, count in (("mug", 0), ("ball", 1)):
        params = arena.with_variants(nominal, thing=name)
        assert arena.compile(params).npair == count
        assert (np.asarray(arena.apply(arena.put_model("warp"), params).pair_margin) >= 0).sum() == count


def test_two_terms():
    arena = table(thing(MUG, CAN))
    message = (
        "Term 'rough' must leave out geom_friction of geom 'thing_mug_g0', which is of the arena's objects: they vary by "
        "ArenaRanges(object_...=...)."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        arena.vary(rough=dr.Term("geom.friction", "thing_mug_g0"))


SHAPED = """<mujoco><worldbody><body name="b">{inertial}<geom name="g" type="box" size=".03 .03 .03"/>
  <geom name="h" size=".02" pos="0 0 .04"/><geom name="v" size=".02" pos="0 0 .04" mass="0" contype="0" conaffinity="0"/>
  </body></worldbody></mujoco>"""
DESK = """<mujoco><worldbody><body name="desk"><geom name="top" type="box" size=".5 .5 .1"/></body>
  <body name="s" pos="0 0 .13"><freejoint/><geom name="s_g0" type="box" size=".03 .03 .03"/></body></worldbody></mujoco>"""
OBJECTS = {
    "one geom": lambda: table(Object("s", full_size=0.05)),
    "variants": lambda: table(Object("s", variants=[Object("a", full_size=0.05), Object("b", "sphere", 0.05)])),
    "a file": lambda: table(Object("s", "mjcf", file=mujoco.MjSpec.from_string(SHAPED.format(inertial="")))),
    "an inertial": lambda: table(Object("s", "mjcf", file=mujoco.MjSpec.from_string(SHAPED.format(inertial=INERTIAL)))),
    "of a scene": lambda: mja.Arena.from_xml(DESK, ["desk"], objects=["s"]),
}
INERTIAL = '<inertial pos="0 0 0" mass=".2" diaginertia="1e-4 1e-4 1e-4"/>'


@pytest.mark.slow
@pytest.mark.parametrize("case", OBJECTS)
def test_terms_of_inertials(case, monkeypatch):
    """`vary` refuses a term that moves the inertial of an object, and names it, just where the proof would refuse the arena."""
    model = OBJECTS[case]().mj_model
    names = [g for g in (model.geom(i).name for i in range(model.ngeom)) if g.startswith("s_")]
    terms = [(f"geom.{what}", g) for what in ("pos", "rpy", "size", "density", "mass") for g in names] + [
        ("body.ipos", "s")
    ]
    refused = set()
    for term in terms:
        try:
            OBJECTS[case]().vary(x=dr.Term(*term))
        except ValueError as error:
            refused |= {term} if "as the inertial of Object 's' follows `object_masses` alone" in str(error) else set()
    monkeypatch.setattr(vary, "_weighing", lambda *_: [])
    stale = set()
    for term in terms:
        arena = OBJECTS[case]()
        try:
            arena.vary(x=dr.Term(*term))
        except ValueError:  # for another reason
            continue
        try:
            assert arena.mj_model
        except ValueError:
            stale.add(term)
    assert refused == stale
    assert len(refused) >= {"variants": 3, "a file": 10}.get(case, 0)


def test_limits_of_contacts():
    """On JAX, MJX would keep the contacts of what is not there, which lies deepest."""
    arena = table(thing(MUG, Object("ball", "sphere")))
    arena.spec.add_numeric(name="max_contact_points", data=[5])
    ranges = mja.ArenaRanges(table_rots=mja.Uniform(0, 1))
    message = (
        "`arena.spec`: max_contact_points makes impl='jax' keep only the deepest contacts, and absent variants would "
        "take their places: leave it out, or use impl='warp'."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(2)), ranges)
