"""Every attribute that can vary is held against the compiler somewhere, and docs/terms.md says where."""

import collections
import functools
import re

import pytest
import whole
from models import ARMS, MJX, SUITE, spec_of
from test_gains import VARIED
from test_whole_without import GOING

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.spec import automatic
from mjx_arenas.terms.attributes.geoms import never_read

REST = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="a" pos="0 0 1"><joint name="a" axis="0 1 0" actuatorfrcrange="-5 5" damping=".1"/><geom name="a" size=".1" pos=".2 0 0"/>
<body name="b" pos=".4 0 0"><joint name="b" axis="0 1 0" actuatorfrcrange="-3 4" damping=".1"/>
<geom name="b" size=".08" pos=".2 0 0"/></body></body>
<body name="c" pos="0 1 1"><joint name="c" type="slide" axis="0 0 1" damping=".1"/><geom name="c" size=".1"/></body></worldbody>
<contact><pair name="one" geom1="a" geom2="c" margin=".01" gap=".005"/>
<pair name="two" geom1="b" geom2="floor" condim="6" margin=".02" gap=".01"/></contact>
<tendon><fixed name="t" armature=".1" actuatorfrcrange="-2 3"><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed></tendon>
<equality><joint name="e" joint1="b" joint2="c" polycoef="0 .1 0 0 0"/></equality>
<actuator><general name="m" joint="a" dyntype="integrator" actlimited="true" actrange="-1 1" gainprm="3"
biastype="affine" biasprm="1 -2 -.5"/>
<general name="p" tendon="t" gainprm="2"/><muscle name="muscle" joint="b" lengthrange="-1 1" force="9"/></actuator></mujoco>"""
ALONE = {
    "body.mass_alone": "a",
    "body.inertia": "b",
    "joint.actfrcrange": None,
    "tendon.actfrcrange": None,
    "tendon.armature": None,
    "actuator.actrange": None,
    "actuator.gainprm": None,
    "actuator.biasprm": None,
    "actuator.lengthrange": None,
    "pair.friction": None,
    "pair.solreffriction": None,
    "pair.solref": None,
    "pair.solimp": None,
    "pair.margin": None,
    "pair.gap": None,
    "equality.solref": None,
    "equality.solimp": None,
    "equality.data": None,
}
"""Attributes that few models have elements for, or none, and of which elements here."""
STARTS = dict.fromkeys(("joint.qpos", "joint.qvel", "equality.active"), "test_start_states.py")
STARTS |= {a: "test_start_poses.py" for a in dr.ATTRIBUTES if a.startswith("body.start_")}
ON_WARP = dict.fromkeys(
    ("geom.surfacevel", "geom.adhesion", "pair.adhesion", "actuator.cranklength"), "test_warp_alone.py"
)
GAINS = dict.fromkeys(
    (f"actuator.{name}" for name in (*VARIED, "diameter") if name not in ("kp", "kv")), "test_gains.py"
)
SAID = {**STARTS, **ON_WARP, **GAINS, "actuator.dampratio": "test_ratios.py", "body.active": "test_coming_and_going.py"}
"""Attributes that are in no number of the compiled model, or that none of these models have, and who holds them."""


@pytest.mark.slow
def test_what_models_lack(impl):
    """As `test_dr.test_everything_at_once`, of a model that was written for it."""
    arena = mja.Arena.from_xml(REST)
    here = {a: name for a, name in ALONE.items() if impl == "warp" or dr.ATTRIBUTES[a].unseen_on_jax is not never_read}
    arena.vary(**{a.replace(".", "_"): dr.Term(a) if name is None else dr.Term(a, name) for a, name in here.items()})
    whole.hold(arena, impl)


@functools.cache
def models_with():
    """Names of the models in which `test_dr` holds each attribute."""
    found = collections.defaultdict(list)
    for name in SUITE | ARMS | MJX:
        spec = spec_of(name)
        automatic.give(spec)
        model = spec.compile()
        terms = {}
        for some in (whole.otherwise, whole.weighed, whole.everything):
            terms |= some(spec, model)
        for attribute, term in terms.items():
            if term.select(spec, model)[0]:
                found[attribute].append(name)
    return found


@pytest.mark.slow
def test_each_is_proven():
    """The column "held in" of the table: so many models, or the test."""
    from test_terms_documented import TEXT

    rows = [row.strip("|").split(" | ") for row in re.findall(r"^\| `\w+\.\w+` \|.*$", TEXT, flags=re.MULTILINE)]
    said = {row[0].strip(" `"): row[-1].strip() for row in rows if len(row) == 9}
    for attribute in dr.ATTRIBUTES:
        n = len(GOING) if attribute == "body.active" else 0 if attribute in SAID else len(models_with()[attribute])
        own = f"`{SAID.get(attribute, 'test_terms_proven.py')}`"
        here = [own] if attribute in ALONE or attribute in SAID else []
        models = [f"{n} model{'s' if n > 1 else ''}"] if n else []
        assert said[attribute] == ", ".join(models + here), attribute


@pytest.mark.xslow
@pytest.mark.slow
def test_how_many_at_once():
    """As docs/terms.md says."""
    from test_terms_documented import TEXT

    counts = [
        len(whole.with_everything(name, impl).quantities) for name in (SUITE | MJX | ARMS) for impl in ("jax", "warp")
    ]
    assert f"in {min(counts)} to {max(counts)} attributes" in TEXT
