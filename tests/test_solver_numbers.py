"""`solref` and `solimp` that MJX computes otherwise than MuJoCo are refused in MJCFs, and flagged where they vary."""

import re

import jax
import numpy as np
import pytest
import test_left_out

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.attribute import IMPEDANCE, SIGNS

pytestmark = [pytest.mark.filterwarnings("ignore:The arena. geoms are inside each other")]
BOTH, JAX = ("jax", "warp"), ("jax",)
ENDS = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="a" pos="0 0 1">
<joint name="a" axis="0 1 0"/><geom size=".05" pos=".2 0 0"/></body><body name="b"><joint name="b" axis="0 1 0"/><geom size=".05"/>
</body></worldbody><equality><joint name="e" joint1="a" joint2="b" {}/></equality></mujoco>"""
ELEMENTS = {
    "geom.sol": ("geom 'ball'", "ball", "sol{}"),
    "pair.sol": ("pair 'p'", "pair", "sol{}"),
    "pair.solreffriction": ("pair 'p'", "pair", "sol{}friction"),
    "joint.sol_limit": ("joint 'a'", "joint", "sol{}limit"),
    "joint.sol_friction": ("joint 'a'", "joint", "sol{}friction"),
    "tendon.sol_limit": ("tendon 't'", "tendon", "sol{}limit"),
    "tendon.sol_friction": ("tendon 't'", "tendon", "sol{}friction"),
    "equality.sol": ("equality 'e'", "", "sol{}"),
}
"""What messages call an element of `test_left_out.SCENE`, its place there, and the attribute in MJCF."""
ACTS = {"limit": ' limited="true" range="-1 1"', "friction": ' frictionloss=".1"'}
"""With what limits and friction have an effect."""
KINDS = {
    "ref": ("-500 1", BOTH, "as it is, though one number is > 0 and the other is not, and MuJoCo takes its default: "),
    "ref other": (
        "0.02 0",
        BOTH,
        "as it is, though one number is > 0 and the other is not, and MuJoCo takes its default: ",
    ),
    "imp": (".9 .8 .001", BOTH, "otherwise than MuJoCo, as its dmin is above its dmax: exchange them, or use C"),
    "imp flat": (".8 .9 0", JAX, "otherwise than MuJoCo, as its width is 0: give dmin and dmax their mean, "),
}
CASES = [(name, kind) for name in ELEMENTS for kind in KINDS if kind[:3] == "ref" or "ref" not in name]


def attribute(name, kind):
    return name if "solref" in name else name.replace("sol", f"sol{kind[:3]}")


def scene(name, kind, numbers):
    """MJCF in which one element has these numbers."""
    _, place, called = ELEMENTS[name]
    given = f'{called.format(kind[:3])}="{numbers}"{ACTS.get(name.partition("_")[2], "")}'
    return test_left_out.of(**{place: given}) if place else ENDS.format(given)


def test_all():
    """Every attribute with such a rule has a case, and every `solref` and `solimp` has the rule."""
    ruled = {name: row.quantity.together for name, row in ATTRIBUTES.items() if "solref" in name or "solimp" in name}
    assert ruled == {n: SIGNS if "solref" in n else IMPEDANCE for n in ruled}
    assert set(ruled) == {attribute(*case) for case in CASES}


@pytest.mark.parametrize(("name", "kind"), CASES)
def test_refused(name, kind):
    numbers, impls, said = KINDS[kind]
    own, called = attribute(name, kind).partition(".")[2], ELEMENTS[name][0]
    verb = "takes" if kind[:3] == "ref" else "computes"
    arena = mja.Arena.from_xml(scene(name, kind, numbers))
    for impl in BOTH:
        if impl not in impls:
            arena.put_model(impl)
            continue
        with pytest.raises(ValueError, match=f"^impl='{impl}' of MJX {verb} the `{own}` of {called} {re.escape(said)}"):
            arena.put_model(impl)


@pytest.mark.parametrize(
    "given",
    [
        {"pair": 'solreffriction="0 0" solref="-500 0"'},
        {"ball": 'solimp=".8 .8 0"'},
        {"ball": 'solimp=".5 .9 .001 0 .5"'},
        {"ball": 'solref="-500 1" contype="0" conaffinity="0"'},
        {"joint": 'solreflimit="-500 1" solimplimit=".9 .8 .001"'},
        {"joint": 'solreffriction="-500 1" solimpfriction=".9 .8 .001"'},
        {"tendon": 'solreflimit="-500 1" solimpfriction=".9 .8 .001"'},
    ],
)
def test_taken(given):
    """What both compute alike, and what no contact, limit or friction has."""
    xml = test_left_out.of(**given)
    xml = re.sub(r"<contact>.*</contact>", "", xml) if "ball" in given else xml
    for impl in BOTH:
        mja.Arena.from_xml(xml).put_model(impl)


@pytest.mark.parametrize(
    ("attribute", "low", "high", "right", "said"),
    [
        (
            "geom.solref",
            [-1, -1],
            [1, 1],
            lambda x: (x[:, 0] > 0) == (x[:, 1] > 0),
            "both numbers must be > 0, or neither, as MuJoCo replaces others by its default and MJX does not",
        ),
        (
            "geom.solimp",
            [0.5, 0.5, 0.001, 0.5, 2],
            [0.9, 0.9, 0.002, 0.5, 2],
            lambda x: x[:, 0] < x[:, 1],
            "dmin must be below dmax and width > 0, or dmin equal dmax, as MJX computes others differently",
        ),
    ],
)
def test_flagged(attribute, low, high, right, said):
    """Worlds of a term are right or flagged, with a sentence; ranges in which none is right are refused."""
    arena = mja.Arena.from_xml(test_left_out.of())
    arena.vary(x=dr.Term(attribute, ["ball"]))
    ranges = mja.ArenaRanges(terms={"x": mja.Uniform(low, high)})
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 100), ranges)
    drawn = np.asarray(batch.params.terms["x"][:, 0])
    assert 20 < right(drawn).sum() < 80
    np.testing.assert_array_equal(batch.valid, right(drawn))
    (text,) = arena.problems(batch.world(int(np.argmin(batch.valid))))
    assert text.startswith(f"`terms.x` of geom 'ball': {said}, got ")
    wrong = drawn[np.argmin(batch.valid)]
    with pytest.raises(ValueError, match=re.escape(said)):
        arena.check_ranges(mja.ArenaRanges(terms={"x": mja.Fixed(wrong)}))


def test_flat():
    """Without a width, MuJoCo takes the mean of dmin and dmax, and MJX on JAX dmax: the same if both are equal."""
    solimp = np.array([[0.8, 0.8, 0, 0.5, 2], [0.8, 0.9, 0, 0.5, 2], [0.8, 0.9, 1e-3, 0.5, 2]])
    np.testing.assert_array_equal(IMPEDANCE.holds(solimp), [True, False, True])


def test_woken_by_friction():
    """The numbers of a friction that a term makes are refused."""
    arena = mja.Arena.from_xml(test_left_out.of(joint='solreffriction="-500 1"'))
    arena.vary(friction=dr.Term("joint.frictionloss", ["a"]))
    with pytest.raises(ValueError, match="`solref_friction` of joint 'a' as it is"):
        arena.put_model("jax")


@pytest.mark.xslow
@pytest.mark.parametrize(("numbers", "alike"), [(KINDS[kind][0], kind) for kind in ("ref", "imp", "imp flat")])
def test_mjx_computes_otherwise(numbers, alike):
    """What is refused is felt differently in a contact, and on the other implementations as in C."""
    plain = {"ref": ("ref", "0.05 1"), "imp": ("imp", ".9 .9 .001"), "imp flat": ("imp", ".9 .9 .001")}[alike]
    xml = scene("pair.sol", alike, numbers)
    test_left_out.held(xml, scene("pair.sol", *plain), KINDS[alike][1])
