"""docs/terms.md lists every refusal of a term: what the code may say is in its tables, and what they say is said."""

import re

import mujoco
import pytest
import test_options_vary
import test_vary_exact
import test_woken
from clauses import codes, of, texts
from idle import Idle
from test_left_out import SPRING_OFF, YIELDS
from test_left_out import of as scene
from test_terms_documented import TEXT

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.build import vary
from mjx_arenas.record import proof
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.aligned import WHY
from mjx_arenas.viz import film

SECTION = TEXT.partition("## What does not")[2].partition("whatever the elements:")[0]
TABLES = [
    [row.strip("| ").split(" | ") for row in table.splitlines()[2:]]
    for table in re.findall(r"(?:^\|.*\n)+", SECTION.replace(" |  |", " | - |"), re.MULTILINE)
]
FILLERS = {"free or ball", "height fields"}
"""What stands for names in a clause."""
ASKED = {
    "geom.size": of(ATTRIBUTES["geom.density"].refused_in_spec) & of(ATTRIBUTES["geom.size"].refused_in_spec) - {WHY},
    "actuator.dampratio": of(ATTRIBUTES["joint.axis"].refused),
}
"""What an attribute only asks whether it is so."""


def pieces(clause):
    """What is between names."""
    return {piece.strip() for piece in clause.split("…") if " " in piece.strip()}


def said(table):
    """By attribute, pieces of the clauses of a table."""
    found = {}
    for names, clause, *_ in table:
        for name in re.findall(r"`(\w+\.\w+)`", names):
            found.setdefault(name, set()).update(pieces(clause))
    return found


@pytest.mark.parametrize(
    ("table", "where"), [(0, ("refused", "refused_in_spec")), (1, ("unseen_on_jax",))], ids=["vary", "jax"]
)
def test_clauses(table, where):
    """Those of each attribute are the texts of the functions that say why it cannot vary."""
    code = {
        name: set().union(*(of(getattr(one, field)) for field in where)) - FILLERS - ASKED.get(name, set())
        for name, one in ATTRIBUTES.items()
    }
    assert len(TABLES) == 3
    assert said(TABLES[table]) == {name: found for name, found in code.items() if found}


TABLE = """<mujoco><worldbody><body name="post"><body name="top" pos="0 0 .5"><geom name="top" type="box" size=".5 .5 .02"/>
<body name="lamp" pos="0 0 .2"><geom size=".1"/></body></body></body></worldbody></mujoco>"""
TWO = """<mujoco><compiler {compiler}/><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="a" pos="0 0 1"><geom name="a" size=".1" {geom}/>{joint}</body>
<body name="b" pos="1 0 1"><joint name="b" axis="0 1 0"/><geom name="b" size=".1" pos=".1 0 0"/></body></worldbody>{more}</mujoco>"""
FIELD = """<mujoco><asset><hfield name="f" nrow="2" ncol="2" size="1 1 .1 .1" elevation="0 0 0 1"/></asset>
<worldbody><geom name="ground" type="hfield" hfield="f"/><body name="a" pos="0 0 1"><freejoint/><geom name="a" size=".1"/>
</body></worldbody></mujoco>"""


def two(compiler="", geom="", joint="", more=""):
    return TWO.format(compiler=compiler, geom=geom, joint=joint, more=more)


def with_terms(arena, impl="warp", **terms):
    arena.vary(**{name: dr.Term(*term) for name, term in terms.items()})
    arena.put_model(impl)


def of_xml(xml, impl="warp", tables=(), **terms):
    with_terms(mja.Arena.from_xml(xml, tables=tables), impl, **terms)


def of_cube(**terms):
    with_terms(mja.TableArena(objects=[mja.Object("cube")]), **terms)


def of_variants(**terms):
    variants = [mja.Object("box"), mja.Object("ball", "sphere")]
    with_terms(mja.TableArena(objects=[mja.Object("thing", variants=variants)]), **terms)


def of_wall():
    arena = mja.Arena.from_xml(two())
    arena.add_part(furniture.Wall("wall", pos=(3, 0, 0), stays=True))
    with_terms(arena, x=("body.active", "wall"))


MOTOR = '<actuator><dcmotor name="b" joint="b" motorconst="1" resistance="1"/></actuator>'
HINGE = '<joint name="a" axis="0 1 0"/>'
DAMPER = '<joint name="a" axis="0 1 0" springdamper=".1 1"/>'
CASES = {
    "object": lambda: of_cube(x=("body.start_pos", "cube")),
    "table": lambda: of_cube(x=("body.active", "table")),
    "slab": lambda: of_cube(x=("geom.pos", "table_collision")),
    "shown slab": lambda: of_cube(x=("geom.pos", "table_visual")),
    "middle": lambda: of_cube(x=("body.ipos", "cube")),
    "inertia": lambda: of_cube(x=("body.inertia", "cube")),
    "place": lambda: of_cube(x=("body.pos", "cube")),
    "part of an object": lambda: of_variants(x=("geom.size", "thing_ball_g0")),
    "wall": of_wall,
    "lamp": lambda: of_xml(TABLE, tables=["top"], x=("body.active", "lamp")),
    "carrier": lambda: of_xml(TABLE, tables=["top"], x=("body.pos", "post")),
    "taken over": lambda: of_xml(two(joint=HINGE), x=("body.mass", "a"), y=("geom.density", "a")),
    "two terms": lambda: of_xml(two(), x=("geom.friction", "a"), y=("geom.friction", ["a", "b"])),
    "axes": lambda: of_xml(two(), x=("body.rpy", "b", "roll"), y=("body.rpy", "b", "yaw")),
    "of tables": lambda: of_cube(x=("geom.friction", "table_collision")),
    "bounded": lambda: of_xml(two(compiler='boundmass=".1"'), x=("body.mass", "b")),
    "tied": lambda: of_xml(two(more='<equality><weld body1="a" body2="b"/></equality>'), x=("body.active", "a")),
    "springdamper": lambda: of_xml(two(joint=DAMPER), x=("body.mass", "a")),
    "its stiffness": lambda: of_xml(two(joint=DAMPER), x=("joint.stiffness", "a")),
    "spring": lambda: of_xml(
        two(more='<tendon><fixed stiffness="9"><joint joint="b" coef="1"/></fixed></tendon>'),
        x=("joint.springref", "b"),
    ),
    "fluid": lambda: of_xml(two(geom='fluidshape="ellipsoid"', joint=HINGE), x=("geom.size", "a")),
    "motor": lambda: of_xml(two(more=MOTOR), x=("actuator.gainprm", "b")),
    "field": lambda: of_xml(FIELD, "jax", x=("geom.size", "a")),
    "object on jax": lambda: test_woken.round_object()[0].put_model("jax"),
    "medium": lambda: test_woken.in_wind("option.density", geom=test_woken.ELLIPSOID)[0].put_model("jax"),
    "flags": lambda: of_xml(scene().replace("<worldbody>", SPRING_OFF), "jax", x=("joint.damping", "a")),
}
CASES["environment"] = lambda: Idle(test_options_vary.arena(), mja.ArenaRanges())
CASES["film"] = lambda: film.c_video(test_options_vary.arena(), test_options_vary.two_in_c(), "x.mp4", seconds=0.1)
if YIELDS:
    CASES["yields"] = lambda: of_xml(scene(joint='springyield=".1"'), x=("joint.stiffness", "a"))


def test_sentences():
    """Each row of the last table is said in some case, but for what nothing is known that says it; and each case says a row."""
    of_no_term = ("damping of an actuator on jax",)
    found = [one[3] for name, one in test_vary_exact.REFUSED.items() if name not in of_no_term]
    for case in CASES.values():
        with pytest.raises(ValueError, match=r".") as raised:
            case()
        found.append(str(raised.value))
    patterns = {row[1]: ".*".join(map(re.escape, row[1].split("…"))) for row in TABLES[2]}
    silent = [row for row, pattern in patterns.items() if not any(re.search(pattern + "$", one) for one in found)]
    assert [row for row in silent if proof.WHY_ELSE not in row and ("springyield" not in row or YIELDS)] == []
    of_elements = [".*".join(map(re.escape, row[1].split("…"))) for table in TABLES[:2] for row in table]
    assert [one for one in found if not any(re.search(p, one) for p in (*patterns.values(), *of_elements))] == []


def test_what_is_said_of_the_rest():
    """Every reason that `vary` gives, and every one of the proof, is in the table."""
    rows = " ".join(row[1] for row in TABLES[2])
    for name in ("_standing", "_placed", "_owned", "_weighing", "_carrying", "_overruled"):
        for code in codes(getattr(vary, name).__code__):
            for text in texts(code):
                assert " " not in text.strip() or text.strip() in rows, text
    for why in (*proof.WHY.values(), proof.WHY_ELSE):
        assert f"and {why}." in rows
    for field in proof.WHY:
        assert f"{field} of … would be stale" in rows


@pytest.mark.filterwarnings("ignore:.*settotalmass")
def test_rules_of_masses_are_named():
    """Where numbers that `vary` writes would change all masses, the rule by which they would is named."""
    arena = mja.Arena.from_xml(two(compiler='settotalmass="7"'))
    with pytest.raises(
        ValueError, match=r"`spec.compiler`: settotalmass would make the masses of all bodies follow from `x`"
    ):
        arena.vary(x=dr.Term("geom.mass", "b"))


@pytest.mark.parametrize(("attribute", "kind"), [("body.ipos", "body"), ("geom.pos", "geom"), ("geom.rpy", "geom")])
def test_objects_of_one_geom_keep_it_in_the_middle(attribute, kind):
    """A term of all elements leaves them out, and one that names them is refused; what hangs beside them varies."""
    spec = mujoco.MjSpec.from_string(two(joint=HINGE))
    made = mja.TableArena(objects=[mja.Object("cube")])
    made.attach(spec, "robot_", pos=(3, 0, 0))
    name = "cube" if kind == "body" else "cube_g0"
    said = f"{kind} {name!r} cannot vary, as it is of object 'cube', whose own quantities say where it is."
    with pytest.raises(ValueError, match=re.escape(said)):
        made.vary(x=dr.Term(attribute, name))
    made.vary(x=dr.Term(attribute))
    assert name not in made.elements("x")
    assert "robot_a" in made.elements("x")
    assert made.record.nominal.terms["x"].size
