"""What is said of terms: of contact pairs, of quantities with names of other things, and of names that MJX has."""

import functools
import pathlib
import re

import jax
import numpy as np
import pytest
import worlds
from mujoco import mjx
from whole import differing, elsewhere

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.named import RATIO, WEIGHT
from mjx_arenas.params.params import with_values
from mjx_arenas.terms.attributes.attribute import TRIANGLE
from mjx_arenas.terms.attributes.fields import attribute_of
from mjx_arenas.terms.attributes.fixed import FIXED

PAIRS = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="toe" pos="0 0 .1"><freejoint/><geom name="toe" size=".1"/></body>
<body name="heel" pos="1 0 .1"><freejoint/><geom name="heel" size=".1"/></body></worldbody>
<contact><pair name="to" geom1="floor" geom2="toe"/><pair name="he" geom1="floor" geom2="heel"/></contact></mujoco>"""


def nominal(arena):
    return jax.tree.map(np.asarray, arena.nominal_params())


def test_contact_pairs_by_their_names():
    """In ranges and in worlds, of one pair and of all."""
    arena = mja.Arena.from_xml(PAIRS)
    arena.vary(
        grip=dr.Term("pair.friction", axes="sliding"), margin=dr.Term("pair.margin", "to"), gap=dr.Term("pair.gap")
    )
    said = "`ranges.terms.margin` of pair 'to' can reach -1.0: it must stay >= 0 [m]."
    both = "`ranges.terms.gap` of all pairs can reach -1.0: it must stay >= 0 [m]."
    for ranges, sentence in (({"margin": mja.Uniform(-1, 1)}, said), ({"gap": mja.Uniform(-1, 1)}, both)):
        with pytest.raises(ValueError, match=r"can reach") as raised:
            arena.check_ranges(mja.ArenaRanges(terms=ranges))
        assert str(raised.value) == sentence
    bad = np.array([[1.0] * 5, [-1.0, 1, 1, 1, 1]])
    problem = "`terms.grip` of pair 'he' must be finite and >= 0 on every axis, got [-1.0, 1.0, 1.0, 1.0, 1.0]."
    assert arena.problems(with_values(nominal(arena), {"grip": bad})) == [problem]


@pytest.mark.parametrize("name", ["pair", "tables", "table", "object", "any", "world", "term"])
def test_quantities_called_like_kinds(name):
    """A name of a quantity is no kind of thing to the rules."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.attach(PAIRS, "a_")
    arena.vary(**{name: dr.Term("pair.margin")})
    params = nominal(arena)
    assert arena.problems(params) == []
    bad = with_values(params, {name: np.array([0.0, -1.0])})
    assert arena.problems(bad) == [f"`terms.{name}` of pair 'a_he' must be finite and >= 0 [m], got -1.0."]


CLOTH = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="ball" pos="2 0 1"><freejoint align="false"/><geom name="ball" size=".1"/></body>
<body name="frame" pos="0 0 1"><geom name="frame" size=".01" pos="0 0 1"/>
<flexcomp name="cloth" type="grid" count="3 2 1" spacing=".1 .1 .1" radius=".01" mass="1" dim="2"><edge equality="true"/>
<contact selfcollide="none"/></flexcomp></body></worldbody></mujoco>"""
WEIGHING = ("mass", "mass_alone", "inertia", "ipos", "pseudo_inertia", "payload")


@functools.cache
def vertices():
    return mja.Arena.from_xml(CLOTH)


@pytest.mark.parametrize("attribute", [*(f"body.{name}" for name in WEIGHING), "joint.pos", "joint.axis"])
def test_vertices_of_flexes_keep_their_weights(attribute):
    """The compiler weighs edges by the masses of their ends, otherwise if the spec gives these numbers of their own."""
    arena, kind = vertices(), attribute.partition(".")[0]
    name = {"body": "cloth_1", "joint": "cloth_1/joint0"}[kind]
    why = "the edges of a flex would have other weights: make an arena for each"
    with pytest.raises(ValueError, match=r"cannot vary") as raised:
        arena.vary(x=dr.Term(attribute, name))
    assert str(raised.value) == f"`x.elements`: {attribute!r} of {kind} {name!r} cannot vary, as {why}."


def test_what_carries_a_flex_stays():
    """The compiled world without a body would have no flex at all."""
    why = "a flex is on it, which the compiler would take away as a whole: make an arena for each"
    for name in ("frame", "cloth_1"):
        with pytest.raises(ValueError, match=re.escape(f"of body '{name}' cannot vary, as {why}.")):
            vertices().vary(x=dr.Term("body.active", name))


def test_flexes_beside_what_varies():
    """All else of an arena with a flex varies exactly, and so do the joints of its vertices."""
    arena = mja.Arena.from_xml(CLOTH)
    names = (
        "body.mass",
        "body.gravcomp",
        "joint.armature",
        "joint.stiffness",
        "joint.ref",
        "equality.solref",
        "geom.friction",
    )
    arena.vary(**{name.replace(".", "_"): dr.Term(name) for name in names})
    assert arena.elements("body_mass") == ("ball", "frame")
    model, params = arena.put_model("warp"), elsewhere(arena, 0.5)
    compiled = arena.compile(params)
    assert (
        differing(
            compiled, worlds.leaves(arena.apply(model, params)), worlds.leaves(mjx.put_model(compiled, impl="warp"))
        )
        == set()
    )


@pytest.mark.parametrize(
    "name",
    [
        "flex.friction",
        "skin.rgba",
        "numeric.data",
        "statistic.extent",
        "visual.headlight",
        "visual.map.znear",
        "size.memory",
    ],
)
def test_kinds_that_stay(name):
    """All attributes of a kind are told why they cannot vary, and what to do instead."""
    row = FIXED[f"{name.partition('.')[0]}.*"]
    with pytest.raises(ValueError, match=r"cannot vary") as raised:
        mja.Arena.from_xml(PAIRS).vary(x=dr.Term(name))
    assert str(raised.value) == f"`x.attribute`: {name!r} cannot vary, as {row.why}: {row.instead}."


FIELDS = {
    "dof_damping": "joint.damping",
    "dof.damping": "joint.damping",
    "dof.armature": "joint.armature",
    "dof_frictionloss": "joint.frictionloss",
    "body_mass": "body.mass",
    "body_iquat": "body.pseudo_inertia",
    "body_quat": "body.rpy",
    "geom_friction": "geom.friction",
    "geom.matid": "geom.material",
    "actuator_gainprm": "actuator.gainprm",
    "jnt_stiffness": "joint.stiffness",
    "jnt.range": "joint.range",
    "qpos0": "joint.ref",
    "cam_fovy": "camera.fovy",
    "opt.gravity": "option.gravity",
    "tendon_lengthspring": "tendon.springlength",
}


@pytest.mark.parametrize("field", FIELDS)
def test_fields_of_the_model(field):
    """Who knows `mjx.Model` is told the attribute that decides a field."""
    with pytest.raises(ValueError, match=r"can vary") as raised:
        mja.Arena.from_xml(PAIRS).vary(x=dr.Term(field))
    assert str(raised.value) == f"`x.attribute`: no attribute {field!r} can vary: did you mean `{FIELDS[field]}`?"


def test_every_field_of_a_term():
    """Each field that a term writes is answered by an attribute that writes it, or has its name."""
    for one in dr.ATTRIBUTES.values():
        for target in (target for target in one.targets if target.field not in (RATIO, WEIGHT)):
            found = attribute_of(target.field)
            assert any(target.field == other.field for other in dr.ATTRIBUTES[found].targets), target.field


@pytest.mark.parametrize(
    ("field", "name"),
    [("geom_contype", "geom.contype"), ("jnt.limited", "joint.limited"), ("stat.extent", "statistic.*")],
)
def test_fields_that_stay(field, name):
    """They are answered as the attributes are."""
    with pytest.raises(ValueError, match=r"cannot vary") as raised:
        mja.Arena.from_xml(PAIRS).vary(x=dr.Term(field))
    assert str(raised.value) == f"`x.attribute`: {field!r} cannot vary, as {FIXED[name].why}: {FIXED[name].instead}."


ROOM = """<mujoco><asset><texture name="sky" type="skybox" builtin="flat" width="4" height="4"/>
<texture name="oak" type="2d" builtin="flat" width="4" height="4"/>
<texture name="pine" type="2d" builtin="flat" width="4" height="4"/>
<material name="wood" texture="oak"/><material name="steel"/></asset>
<worldbody><geom name="floor" type="plane" size="5 5 .1" material="wood"/></worldbody></mujoco>"""
FILE = """arena:
  type: Arena.from_xml
  xml: {xml}
  then:
    - attach: {{robot: other.xml, prefix: r_}}
    - add_material: {{name: paint, texture: {{Checker: {{}}}}}}
    - vary:
        look: {{attribute: material.texture, elements: wood}}
        skin: {{attribute: geom.material, elements: floor}}
ranges:
  terms:
    look: {{Choice: {{values: [{texture}, pine, -1], p: [0.2, 0.3, 0.5]}}}}
    skin: {{Fixed: {material}}}
"""


def written(folder, texture="r_oak", material="paint"):
    (folder / "room.xml").write_text(ROOM)
    (folder / "other.xml").write_text(ROOM)
    path = folder / "arena.yaml"
    path.write_text(FILE.format(xml="room.xml", texture=texture, material=material))
    return path


def test_names_of_textures_in_files(tmp_path):
    """They are the compiled model's ids, whatever else has textures; and a file that is saved has the same."""
    arena, ranges = mja.load(written(tmp_path))
    model = arena.mj_model
    ids = [model.tex("r_oak").id, model.tex("pine").id, -1]
    assert len({model.ntex, *ids}) == 4
    assert ranges.terms == {"look": mja.Choice(ids, p=[0.2, 0.3, 0.5]), "skin": mja.Fixed(model.mat("paint").id)}
    mja.save(tmp_path / "again.yaml", arena, ranges)
    assert mja.load(tmp_path / "again.yaml")[1] == ranges


def test_unknown_names_of_textures_in_files(tmp_path):
    """The near one is offered."""
    with pytest.raises(ValueError, match=r"2 problems") as raised:
        mja.load(written(tmp_path, "oka", "pain"))
    for said in (
        "be a texture of the arena or its number, got 'oka': did you mean `oak`?",
        "'pain': did you mean `paint`?",
    ):
        assert said in str(raised.value)


BOXES = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint/><inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body>
<body name="b" pos="0 1 1"><joint/><inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .2"/></body></worldbody></mujoco>"""
SPLITS = {
    "absolute": (mja.Uniform([0.1, 0.1, 0.3], [0.12, 0.12, 0.4]), "of all bodies", "[0.12, 0.12, 0.3]"),
    "second": (
        mja.Uniform([0.9, 0.9, 1.1], [0.99, 0.99, 1.2], relative="scale"),
        "of body 'b'",
        "[0.099, 0.099, 0.22]",
    ),
    "first": (mja.Uniform([0.3, 0.1, 0.1], [0.4, 0.14, 0.14]), "of all bodies", "[0.3, 0.14, 0.14]"),
    "chosen": (mja.Choice([[0.1, 0.1, 0.3], [0.1, 0.1, 0.5]]), "of all bodies", "[0.1, 0.1, 0.3]"),
    "some": (mja.Uniform([0.1, 0.1, 0.1], [0.2, 0.2, 0.9]), None, None),
    "an edge": (mja.Uniform([0.1, 0.1, 0.25], [0.125, 0.125, 0.9]), None, None),
}


@pytest.mark.parametrize("case", SPLITS)
def test_moments_of_no_body(case):
    """A range of which no draw is an inertia is refused, one of which some are is not."""
    given, whose, got = SPLITS[case]
    arena = mja.Arena.from_xml(BOXES)
    arena.vary(moments=dr.Term("body.inertia"))
    ranges = mja.ArenaRanges(terms={"moments": given})
    if whose is None:
        arena.check_ranges(ranges)
        return
    with pytest.raises(ValueError, match=r"sum of the other two") as raised:
        arena.check_ranges(ranges)
    said = f"`ranges.terms.moments` {whose}: no moment of inertia may exceed the sum of the other two, got {got}."
    assert str(raised.value) == said


def test_best_moments():
    """Those that are tried are possible if any on a grid of the range are."""
    random = np.random.default_rng(0)
    low, span = random.uniform(0.02, 0.6, (200, 3)), random.uniform(0, 0.2, (200, 3))
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 21)] * 3), -1).reshape(-1, 1, 3)
    some = np.stack([TRIANGLE.holds(low + span * x[0]) for x in grid]).any(0)
    best = TRIANGLE.best(low, low + span)
    assert ((best >= low) & (best <= low + span)).all()
    assert (TRIANGLE.holds(best) >= some).all()
    assert 20 < (~some).sum() < 180


ALL = """<mujoco><option density="1"/><worldbody><light name="l"/><camera name="c" sensorsize=".1 .1" focal=".1 .1" resolution="9 9"/>
<site name="s"/><body name="f" pos="2 0 1"><freejoint align="false"/><geom name="f" type="box" size=".1 .1 .1" pos=".01 0 0"/></body>
<body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" range="-1 1"/><geom name="g" type="box" size=".1 .05 .03"/></body></worldbody>
<contact><pair name="p" geom1="f" geom2="g"/></contact><equality><joint name="e" joint1="j"/></equality>
<tendon><fixed name="t" limited="true" range="-1 1"><joint joint="j" coef="1"/></fixed></tendon>
<actuator><general name="u" joint="j" ctrlrange="-1 1" forcerange="-1 1"/></actuator></mujoco>"""
TOGETHER = {"body.rpy", "geom.rpy", "site.rpy", "camera.rpy", "body.start_rpy", "body.pseudo_inertia", "body.payload"}
TOGETHER |= {"joint.axis", "light.dir", "camera.focal"}
APART = [name for name, one in dr.ATTRIBUTES.items() if "," in one.quantity.axes]


@pytest.mark.parametrize("attribute", APART)
def test_axes_of_one_element(attribute):
    """Two terms may have different axes of one element, but where these are written together, which the sentence says."""
    arena, axes = mja.Arena.from_xml(ALL), dr.ATTRIBUTES[attribute].quantity.axes.split(", ")
    if all(dr.Term(attribute).reasons(arena.spec, arena.spec.copy().compile()).values()):
        return  # no element of this arena can
    arena.vary(x=dr.Term(attribute, axes=axes[0]))
    other = dr.Term(attribute, arena.elements("x"), axes=axes[1])
    if attribute not in TOGETHER:
        arena.vary(y=other)
        return
    said = f"Terms 'x' and 'y' have axes of '{attribute}' of .*, which are written together: give all axes to one term."
    with pytest.raises(ValueError, match=f"^{said}$"):
        arena.vary(y=other)


def test_page_names_axes_that_are_written_together():
    text = (pathlib.Path(__file__).parent.parent / "docs" / "terms.md").read_text()
    (line,) = [line for line in text.splitlines() if line.startswith("- Two terms may have different axes")]
    named = set(re.findall(r"`([\w….]+)`", line)) - {"pos", "….rpy"}
    assert named == {name for name in TOGETHER if not name.endswith(".rpy")}
