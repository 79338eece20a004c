"""What has no effect in the MJCF and has one in some world is refused by `put_model`, flagged, or as in C."""

import dataclasses

import jax
import mujoco
import numpy as np
import oracle
import pytest
import test_from_neutral
import test_gains
import test_left_out
import test_terms_proven
from mujoco import mjx
from mujoco.mjx._src import collision_driver

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.furniture.part import DAMPING, whole
from mjx_arenas.params.params import with_values
from mjx_arenas.record.elsewhere import elsewhere
from mjx_arenas.sim import left_out
from mjx_arenas.spec import comparing
from mjx_arenas.terms.attributes import ATTRIBUTES
from mjx_arenas.terms.attributes.attribute import IMPEDANCE, SIGNS

STEPS = 20
WIND = """<mujoco><option wind="3 1 0" gravity="0 0 0"><flag {flag}/></option><worldbody>
<body name="b"><joint name="x" type="slide"/><joint name="h" axis="0 1 0"/>
<geom name="g" type="ellipsoid" size=".1 .2 .3" pos=".2 0 .1" density="50" {geom}/></body></worldbody></mujoco>"""
ROUND = """<mujoco><option gravity="0 0 0"/><worldbody><site name="s0" pos="-1 .05 .66"/>
<body name="table" pos="0 0 .5"><geom name="table" type="box" size=".5 .5 .02"/></body>
<body name="m" pos="1 .05 .66"><joint type="slide"/><geom size=".1" contype="0" conaffinity="0"/><site name="s1"/></body></worldbody>
</mujoco>"""


def in_wind(term, flag="", geom=""):
    """An arena in which a medium comes with a term."""
    arena = mja.Arena.from_xml(WIND.format(flag=flag, geom=geom))
    arena.vary(medium=dr.Term(term))
    return arena, {"medium": np.array([500.0 if term == "option.density" else 5.0])}


class Loose(furniture.Drawers):
    """Drawers of somebody who lets them slide without friction."""

    @property
    def own(self):
        return super().own | {"frictionloss": whole(DAMPING, self.frictionloss)}


def drawers(kind=furniture.Drawers, flag="", **numbers):
    arena = mja.Arena.from_xml(f"<mujoco><option><flag {flag}/></option></mujoco>")
    arena.add_part(kind("d", heights=(0.2,), openings=(0.1,), **numbers))
    return arena


def round_object():
    """A tendon passes a ball outside, and inside where it is large enough to have the site in it."""
    arena = mja.Arena.from_xml(ROUND, tables=["table"])
    arena.add_object(mja.Object("ball", "sphere", full_size=0.2))
    arena.spec.body("ball").add_site(name="side", pos=[0, 0, 0.105])
    tendon = arena.spec.add_tendon(name="t", springlength=[0, 1])
    tendon.stiffness = 100 if np.ndim(tendon.stiffness) == 0 else [100, 0, 0]
    tendon.wrap_site("s0")
    tendon.wrap_geom(arena.spec.body("ball").geoms[0].name, "side")
    tendon.wrap_site("s1")
    return arena, {"object_full_sizes": np.full((1, 3), 0.5)}


FLAGS = "takes the flags `spring` and `damper` for one"
DRAGS = "leaves out the `fluidshape` of geom 'g'"
SPRING = 'spring="disable"'
ELLIPSOID = 'fluidshape="ellipsoid"'
WOKEN = {
    "density of an ellipsoid": (lambda: in_wind("option.density", geom=ELLIPSOID), DRAGS),
    "viscosity of an ellipsoid": (lambda: in_wind("option.viscosity", geom=ELLIPSOID), DRAGS),
    "density without springs": (lambda: in_wind("option.density", SPRING), FLAGS),
    "viscosity without springs": (lambda: in_wind("option.viscosity", SPRING), FLAGS),
    "density": (lambda: in_wind("option.density"), ""),
    "viscosity": (lambda: in_wind("option.viscosity"), ""),
    "damping of a part": (lambda: (drawers(flag=SPRING, damping=0.0), {"d.damping": np.full(1, 30.0)}), FLAGS),
    "friction of a part": (
        lambda: (drawers(Loose, frictionloss=0.0, damping=0.0), {"d.frictionloss": np.full(1, 3.0)}),
        "cannot vary 'd.frictionloss' of joint 'd_drawer0', as it is 0 in the MJCF, which leaves it out of the step",
    ),
    "size of an object": (
        round_object,
        "cannot vary 'object_full_sizes' of geom 'ball_g0', as MJX decides once whether a tendon passes inside",
    ),
}
"""An arena with numbers of one world in which something acts that does not act nominally, and what MJX on JAX says; "" if it is right."""


@pytest.mark.parametrize("case", [case for case, (_, said) in WOKEN.items() if said])
def test_refused(case):
    make, said = WOKEN[case]
    with pytest.raises(ValueError, match=f"^impl='jax' of MJX {said}"):
        make()[0].put_model("jax")


def test_refused_without_put_model():
    """Templates of MJX's own `put_model`, such as those of somebody else's environment, are looked at, too."""
    arena, values = WOKEN["density without springs"][0]()
    model = mjx.put_model(arena.mj_model, impl="jax")
    ranges = mja.ArenaRanges(terms={"medium": mja.Uniform(100, 500)})
    params = with_values(jax.tree.map(np.asarray, arena.nominal_params()), values)
    for use in (
        lambda: arena.apply(model, params),
        lambda: arena.randomize(model, mja.world_keys(0, range(2)), ranges),
        lambda: arena.randomization_fn(ranges)(model, jax.random.split(jax.random.key(0), 2)),
    ):
        with pytest.raises(ValueError, match=f"^impl='jax' of MJX {FLAGS}"):
            use()


RIGHT = [(case, impl) for case, (_, said) in WOKEN.items() for impl in ("jax", "warp") if impl == "warp" or not said]


@pytest.mark.slow
@pytest.mark.parametrize(("case", "impl"), RIGHT, indirect=["impl"])
def test_as_in_c(case, impl):
    """Where it is not refused, it acts as in C; and it acts."""
    arena, values = WOKEN[case][0]()
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    every = [nominal, with_values(nominal, values)]
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda *x: np.stack(x), *every))
    data = mja.make_data(batch)
    data = data.replace(qvel=data.qvel.at[:, 0].add(-0.2))
    got, want = np.asarray(mja.rollout(batch, data, STEPS).qvel), []
    for i, params in enumerate(every):
        model = arena.compile(params)
        c = mujoco.MjData(model)
        c.qpos[:], c.qvel[0] = data.qpos[i], -0.2
        mujoco.mj_step(model, c, STEPS)
        want.append(c.qvel.copy())
    effect = np.abs(want[1] - want[0]).max()
    assert effect > 1e-3
    np.testing.assert_allclose(got, want, atol=2e-3 * effect, rtol=1e-5)
    assert np.asarray(batch.valid).all()


@pytest.mark.slow
@pytest.mark.parametrize("of_term", [True, False])
def test_limits_of_parts_meet(of_term):
    """The range of a drawer follows from its size: worlds in which its margin is more than half of it are flagged."""
    arena, terms = drawers(), {"d.size": mja.Uniform([0.15, 0.5], [0.5, 0.6])}
    if of_term:
        arena.vary(margin=dr.Term("joint.margin", "d_drawer0"))
        terms["margin"] = mja.Uniform(0.05, 0.15)
    else:
        arena.spec.joint("d_drawer0").margin = 0.1
    n = 60
    batch = arena.randomize(
        arena.put_model("jax"), jax.random.split(jax.random.key(0), n), mja.ArenaRanges(terms=terms)
    )
    (low, high), margin = np.asarray(batch.model.jnt_range)[:, 0].T, np.broadcast_to(batch.model.jnt_margin, (n, 1))
    meet = high - low < 2 * margin[:, 0]
    assert 10 < meet.sum() < n - 10
    np.testing.assert_array_equal(batch.valid, ~meet)
    i = int(np.argmax(meet))
    compiled = arena.compile(batch.world(i))
    assert compiled.jnt_range[0, 1] < 2 * compiled.jnt_margin[0]
    said = "The `margin` of joint 'd_drawer0' is more than half of its `range`: MJX holds only one of its limits at a time."
    assert arena.problems(batch.world(i)) == [said]


class Read:
    """A model of MuJoCo that notes which of its fields are read."""

    def __init__(self, model, found, prefix=""):
        self._of = model, found, prefix

    def __getattr__(self, name):
        model, found, prefix = self._of
        value = getattr(model, name)
        if name == "opt":
            return Read(value, found, "opt.")
        found.add(prefix + name)
        return value


RULES = {
    **{f"{one.kind} {one.attribute}": one.given for one in left_out.ELEMENTS},
    **{f"{kind} {i}": differs for i, (kind, differs, *_) in enumerate(left_out.OTHERWISE)},
    **{f"option {i}": has for i, (has, *_) in enumerate(left_out.OPTIONS)},
    "pairs": lambda model: list(collision_driver.geom_pairs(model)),  # of which put_model refuses some on JAX
}
HARMLESS = {
    "jnt_range": "worlds whose limits meet are not `valid` (rules/limit_rules.py)",
    "jnt_margin": "the same",
    "tendon_range": "the same",
    "tendon_margin": "the same",
    "geom_friction": "worlds whose contacts have too little are not `valid` (rules/sliding_rules.py)",
    "pair_friction": "the same",
    **{
        target.field: "worlds in which it is none that MJX computes as MuJoCo are not `valid` (`together` of the attribute)"
        for row in ATTRIBUTES.values()
        for target in row.targets
        if row.quantity.together in (SIGNS, IMPEDANCE)
    },
    "geom_surfacevel": "`arena.vary` refuses it where the MJCF has none, and MJX on JAX where it varies",
    "geom_adhesion": "the same",
    "pair_adhesion": "the same",
}
"""Fields that rules read and worlds may differ in, and why they need not wake anything; others are in `left_out.WAKES`."""
SCENES = [
    *map(test_left_out.scene, test_left_out.CASES),
    *map(test_left_out.of_option, test_left_out.OPTIONS),
    *(xml for xml, *_ in test_left_out.OTHERWISE.values()),
    *test_left_out.NOTHING_LEFT_OUT.values(),
]


def differing():
    """Fields of the model in which worlds may differ: those of all attributes, and of an arena that has everything else."""
    found = {target.field for one in ATTRIBUTES.values() for target in one.targets}
    arena = mja.TableArena(
        objects=[mja.Object("a"), mja.Object("b", variants=[mja.Object("c"), mja.Object("d", "sphere")])]
    )
    arena.add_part(furniture.Drawers("drawers", pos=(2, 0, 0)))
    scene = arena.record.scene
    return found | {owned.field for owned in scene.owned} | set(scene.absent)


@pytest.mark.skipif(not test_left_out.YIELDS, reason="of MuJoCo 4")
def test_what_rules_read():
    """Each rule of what MJX leaves out reads fields that are the same in all worlds, that are woken, or that have a reason."""
    found: dict[str, set[str]] = {name: set() for name in RULES}
    for xml in SCENES:
        model = mujoco.MjModel.from_xml_string(xml)
        for name, rule in RULES.items():
            rule(Read(model, found[name]))
    assert all(found.values())
    read = set().union(*found.values()) & differing()
    assert read == left_out.WAKES | HARMLESS.keys()


SEEN = """<mujoco><option wind="1 0 0"/><asset><texture name="t" type="2d" builtin="flat" width="4" height="4"/>
<texture name="u" type="2d" builtin="flat" width="4" height="4"/><material name="m" texture="t"/><material name="n"/></asset><worldbody>
<light name="l" pos="0 0 3"/><camera name="c" pos="0 0 2"/><camera name="d" focal=".02 .02" sensorsize=".02 .01" resolution="8 4"/>
<geom name="floor" type="plane" size="5 5 .1" material="m"/><site name="s0" pos="-1 .05 1"/>
<body name="w" pos="0 0 1"><geom name="w" size=".2" contype="0" conaffinity="0"/><site name="side" pos="0 0 .19"/></body>
<body name="s" pos="1 0 1"><joint name="s" type="slide" axis="1 0 0" range="-1 1"/><geom name="s" size=".1"/><site name="s1"/>
<site name="crank" pos="0 .1 0"/></body>
<body name="k" pos="1 0 2"><joint name="k" axis="0 1 0"/><geom name="k" size=".1"/><site name="pin" pos="0 0 .1"/>
</body><body name="free" pos="3 0 1"><freejoint name="free"/><geom name="free" size=".1" {geom}/></body></worldbody>
<tendon><spatial name="t" range="0 3" limited="true" springlength="0 1">
<site site="s0"/><geom geom="w" sidesite="side"/><site site="s1"/></spatial></tendon>
<actuator><position name="p" joint="s" kp="9" kv="1" ctrlrange="-1 1" forcerange="-9 9"/>{actuator}</actuator></mujoco>"""
CRANK = '<general name="crank" cranksite="pin" slidersite="crank" cranklength=".3"/>'
ACTUATED = test_gains.OTHERS.replace(
    "</actuator>", '<position name="rated" joint="j" kp="3" dampratio="1"/>{}</actuator>'
)
STICKY = 'surfacevel=".1 0 0 0 0 0" adhesion=".1"'
TEMPLATES = {
    "jax": (
        test_from_neutral.NEUTRAL.format(option='wind="1 0 0"'),
        test_terms_proven.REST,
        SEEN.format(geom="", actuator=""),
        ACTUATED.format(""),
    ),
    "warp": (
        test_from_neutral.NEUTRAL.format(option='wind="1 0 0"'),
        test_terms_proven.REST.replace('name="one"', 'name="one" adhesion=".1"'),
        SEEN.format(geom=STICKY, actuator=CRANK),
        ACTUATED.format('<adhesion name="sticks" body="b" ctrlrange="0 1" gain="2"/>'),
    ),
}
EXPLAINED = {
    "jax": {},
    "warp": {
        **dict.fromkeys(("ngravcomp", "flg_gravcomp"), "Warp computes it for each body (test_from_nothing_on_warp)"),
        **dict.fromkeys(
            ("_impl.has_tendon_stiffness", "_impl.has_tendon_damping", "_impl.has_efm_actuator"),
            "worlds have the effects of C all the same (test_vary_exact.test_coupled_from_nothing)",
        ),
    },
}
"""What `mjx.put_model` decides by numbers that may vary, and why no world is wrong for it."""
ON_WARP = ("geom.surfacevel", "geom.adhesion", "pair.adhesion", "actuator.cranklength", "actuator.gain")
DECIDED = {
    "ngravcomp",
    "flg_gravcomp",
    "_impl.dof_hasfrictionloss",
    "_impl.tendon_hasfrictionloss",
    "_impl.is_wrap_inside",
}
"""What it decides on JAX, where the attribute is refused for it."""


def statics(one, path=""):
    """What of a model of MJX is no array on the device, and so the same in all worlds, by name."""
    found = {}
    for own in dataclasses.fields(one):
        value, name = getattr(one, own.name), f"{path}{own.name}"
        if dataclasses.is_dataclass(value):
            found |= statics(value, f"{name}.")
        elif not isinstance(value, jax.Array):
            found[name] = value
    return found


def same(one, other):
    if not isinstance(one, (bool, np.generic, np.ndarray)):
        return repr(one) == repr(other)
    return np.array_equal(one, other, equal_nan=np.asarray(one).dtype.kind == "f")


class Nominal:
    """What is static in the template of an arena; put anew only where its compiled model is another than the last."""

    def __init__(self, impl):
        self.impl, self.last, self.found = impl, None, {}

    def of(self, arena):
        if self.last is None or comparing.differing(self.last, arena.mj_model):
            self.last, self.found = arena.mj_model, statics(mjx.put_model(arena.mj_model, impl=self.impl))
        return self.found


def decided_by(arena, quantity, nominal):
    """Names of what is static, and other in a world that differs by one quantity alone."""
    other = arena.compile(elsewhere(arena.record.nominal, arena.record.parts, [quantity], 1.0))
    one, two = nominal.of(arena), statics(mjx.put_model(other, impl=nominal.impl))
    return {name for name in one if not same(one[name], two[name])} - oracle.STRUCTURE_MAY_DIFFER.keys()


@pytest.mark.slow
def test_templates_decide_nothing_of_tables(impl):
    """The same of all numbers of tables, objects and parts; what comes and goes is compiled with all that there is."""
    arena, _ = round_object()
    arena.add_object(mja.Object("cube"))
    for part in (furniture.Drawers("drawers", pos=(3, 0, 0)), furniture.Cupboard("cupboard", pos=(3, 2, 1))):
        arena.add_part(part)
    numbers = [name for name in arena.record.parts.quantities if not name.endswith("active") and name != "has_legs"]
    assert len(numbers) > 25
    nominal = Nominal(impl)
    found = {name: decided_by(arena, name, nominal) for name in numbers}
    refused = {"_impl.is_wrap_inside"} if impl == "jax" else set()  # see `test_refused`
    assert {name: wrong for name, wrong in found.items() if wrong} == (
        {"object_full_sizes": refused} if refused else {}
    )


@pytest.mark.xslow
def test_templates_decide_nothing(impl):
    """What is static in a template is what the recompiled world's has, for each attribute alone; or the attribute is refused."""
    held, decided = set(), set()
    for xml in TEMPLATES[impl]:
        nominal = Nominal(impl)
        for attribute in ATTRIBUTES.keys() - {"body.active"}:  # compiled with all that there is
            arena = mja.Arena.from_xml(xml)
            try:
                arena.vary(x=dr.Term(attribute))
                arena.record  # noqa: B018
            except ValueError:
                continue
            held.add(attribute)
            wrong = decided_by(arena, "x", nominal)
            decided |= wrong
            if wrong - EXPLAINED[impl].keys():
                with pytest.raises(ValueError, match=r"^impl='jax' of MJX cannot vary"):
                    arena.put_model(impl)
    assert ATTRIBUTES.keys() - held == {"body.active"} | ({*ON_WARP} if impl == "jax" else set())
    assert decided == (DECIDED if impl == "jax" else EXPLAINED["warp"].keys())
