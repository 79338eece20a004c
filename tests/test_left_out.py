"""What MuJoCo simulates and MJX leaves out is refused by `put_model`; and nothing else of the model is left out."""

import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pages
import pytest
from mujoco import mjx
from mujoco.mjx._src import types

import mjx_arenas as mja
from mjx_arenas.sim import left_out
from mjx_arenas.sim.left_out import ELEMENTS

pytestmark = [
    pytest.mark.filterwarnings("ignore:The arena. geoms are inside each other"),  # the ball, so that contacts stick
]
SCENE = """<mujoco><option {option}/><worldbody><geom name="floor" type="plane" size="5 5 .1" {floor}/>
<body name="a" pos="0 0 1"><joint name="a" axis="0 1 0" {joint}/><geom size=".05" pos=".2 0 0"/>
<body name="b" pos=".4 0 0"><joint name="b" axis="0 1 0"/><geom size=".05" pos=".2 0 0"/></body></body>
<body name="ball" pos="1 0 .0995"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
<geom name="ball" size=".1" {ball}/></body></worldbody>
<contact><pair name="p" geom1="ball" geom2="floor" {pair}/></contact>
<tendon><fixed name="t" {tendon}><joint joint="a" coef="2"/><joint joint="b" coef="-1"/></fixed></tendon>
<actuator><general name="m" joint="a" {actuator}/></actuator><sensor><jointvel name="s" joint="a" {sensor}/></sensor></mujoco>"""
CASES = {
    ("actuator", "armature"): 'armature=".5"',
    ("actuator", "damping"): 'damping="3"',
    ("actuator", "delay"): 'delay=".01" nsample="6"',
    ("actuator", "actearly"): 'dyntype="filter" dynprm=".01" actearly="true"',
    ("joint", "springyield"): 'stiffness="100" springyield=".1"',
    ("tendon", "springyield"): 'stiffness="100" springyield=".1"',
    ("joint", "stiffness"): 'stiffness="1 90 90"',
    ("joint", "damping"): 'damping="1 5 5"',
    ("tendon", "stiffness"): 'stiffness="1 90 90"',
    ("tendon", "damping"): 'damping=".1 .1 .1"',
    ("geom", "surfacevel"): 'surfacevel=".5 0 0 0 0 0"',
    ("geom", "adhesion"): 'adhesion="50"',
    ("geom", "fluidshape"): 'fluidshape="ellipsoid"',
    ("pair", "adhesion"): 'adhesion="50"',
    ("sensor", "delay"): 'delay=".01" nsample="6"',
    ("sensor", "interval"): 'interval=".012" nsample="1"',
}
UNFELT = ("tendon", "springyield")
"""C gives way only in `plastic`, which a fixed tendon never reaches here."""


def scene(case):
    """MJCF in which one element has what is left out."""
    kinds = dict.fromkeys(("floor", "ball", "option", "joint", "pair", "tendon", "actuator", "sensor"), "")
    kinds["ball" if case[1] == "fluidshape" else "floor" if case[0] == "geom" else case[0]] = CASES[case]
    kinds["option"] = 'density="2000"' if case[1] == "fluidshape" else ""
    if case == ("geom", "adhesion"):
        kinds["pair"] = ""
    xml = SCENE.format(**kinds)
    return xml if case[0] != "geom" else re.sub(r"<contact>.*</contact>", "", xml)


def test_all_cases():
    assert CASES.keys() == {(one.kind, one.attribute) for one in ELEMENTS}


def test_documented():
    """docs/exactness.md says of each on which implementations it is refused."""
    (table,) = (
        text for text in pages.tables("docs/exactness.md") if text.startswith("| what is refused | jax | warp |")
    )
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]
    told = {name: (jax, warp) for what, jax, warp in rows for name in re.findall(r"`(\w+\.\w+)`", what)}
    for one in ELEMENTS:
        on = tuple("refused" if impl in one.impls else "" for impl in ("jax", "warp"))
        assert told.pop(f"{one.kind}.{one.attribute}") == on
    assert all(name.startswith("option.") for name in told)


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_refused(case):
    """In one sentence, where MJX would leave it out."""
    if case[1] == "springyield" and not hasattr(mujoco.MjModel, "jnt_springyield"):
        pytest.skip("of MuJoCo 4")
    (row,) = (one for one in ELEMENTS if (one.kind, one.attribute) == case)
    for impl in row.impls:
        arena = mja.Arena.from_xml(scene(case))
        with pytest.raises(
            ValueError, match=rf"^impl='{impl}' of MJX leaves out the [^:]*`{case[1]}` of {case[0]} '\w+': .*\.$"
        ):
            arena.put_model(impl)


OPTIONS = {
    "actuatorgroupdisable": (
        '<option actuatorgroupdisable="0"/>',
        ("jax", "warp"),
        "leaves out the `actuatorgroupdisable` of <option>: ",
    ),
    "noslip": ('<option noslip_iterations="20"/>', ("jax",), "leaves out `noslip_iterations`"),
    "damper": (
        '<option><flag damper="disable"/></option>',
        ("jax",),
        "takes the flags `spring` and `damper` for one, ",
    ),
    "spring": (
        '<option><flag spring="disable"/></option>',
        ("jax",),
        "takes the flags `spring` and `damper` for one, ",
    ),
}
if hasattr(mujoco.mjtIntegrator, "mjINT_DISCRETE"):
    OPTIONS["discrete"] = (
        '<option integrator="discrete"/>',
        ("jax",),
        "does not have the integrator `discrete`: use another one, or use impl='warp'",
    )
SPRUNG = SCENE.format(
    option="", ball="", floor="", joint='stiffness="50" damping=".5"', pair="", tendon="", actuator="", sensor=""
)


def of_option(name):
    """MJCF with an option that is left out."""
    return SPRUNG.replace("<worldbody>", OPTIONS[name][0] + "<worldbody>")


@pytest.mark.parametrize("name", OPTIONS)
def test_options_are_refused(name):
    for impl in OPTIONS[name][1]:
        with pytest.raises(ValueError, match=f"^impl='{impl}' of MJX {re.escape(OPTIONS[name][2])}"):
            mja.Arena.from_xml(of_option(name)).put_model(impl)


def with_flags(**flags):
    """<option> with integrator RK4 and flags."""
    return f'integrator="RK4"><flag {" ".join(f"{k}={v!r}" for k, v in flags.items())}/></option><option '


def of(**kinds):
    """MJCF with attributes by kinds of elements."""
    return SCENE.format(
        **dict.fromkeys(("floor", "ball", "option", "joint", "pair", "tendon", "actuator", "sensor"), "") | kinds
    )


def looking(how, option='integrator="RK4"'):
    """MJCF with a camera, and a sensor of where it looks."""
    camera = f'<worldbody><site name="base"/><body name="post"/><camera name="c" pos="1 -.2 .1" {how}/>'
    sensor = '<framezaxis name="s" objtype="camera" objname="c"/>'
    return of(option=option).replace("<worldbody>", camera).replace('<jointvel name="s" joint="a" />', sensor)


def beside(world, body):
    """MJCF with a tendon round a geom, on the side of a site of the world or of the geom's body."""
    ends = f"""<worldbody><site name="s0" pos="-1 .05 2"/>{world}<body name="w" pos="0 0 2">
<geom name="w" size=".2" contype="0" conaffinity="0"/>{body}</body>"""
    path = """</fixed><spatial name="round" stiffness="500" springlength="0 1"><site site="s0"/><geom geom="w" sidesite="side"/>
<site site="s1"/></spatial>"""
    moving = '<site name="s1" pos="0 .05 1.9"/><geom name="ball"'
    return of().replace("<worldbody>", ends).replace("</fixed>", path).replace('<geom name="ball"', moving)


EXACT = 'dyntype="filterexact" dynprm=".003" gainprm="20"'
OFF = '<option integrator="RK4"><flag sensor="disable"/></option><worldbody>'
OTHERWISE = {
    "limits of a joint": (
        of(joint='limited="true" range="-5 40" margin=".7" solreflimit=".1 1"'),
        of(joint='limited="true" range="-5 400" margin=".7" solreflimit=".1 1"'),
        ("jax", "warp"),
        "holds one limit of joint 'a' at a time, ",
    ),
    "limits of a tendon": (
        of(tendon='limited="true" range="-.2 .2" margin=".3" solreflimit=".1 1"'),
        of(tendon='limited="true" range="-2 .2" margin=".3" solreflimit=".1 1"'),
        ("jax", "warp"),
        "holds one limit of tendon 't' at a time, ",
    ),
    "sensor of RK4": (
        of(option='integrator="RK4"'),
        of(),
        ("jax", "warp"),
        "measures sensor 's' at the last stage of the integrator RK4, ",
    ),
    "clock of RK4": (
        of(option='integrator="RK4"').replace('<jointvel name="s" joint="a" />', '<clock name="s"/>'),
        of().replace('<jointvel name="s" joint="a" />', '<clock name="s" cutoff=".001"/>'),
        ("jax",),
        "measures sensor 's' at the last stage of the integrator RK4, ",
    ),
    "camera of RK4": (
        looking('mode="targetbody" target="ball"'),
        looking('mode="targetbody" target="ball"', ""),
        ("jax", "warp"),
        "measures sensor 's' at the last stage of the integrator RK4, ",
    ),
    "side of a tendon": (
        beside('<site name="side" pos="0 .1 2"/>', ""),
        beside("", '<site name="side" pos="0 .3 0"/>'),
        ("jax",),
        "takes the `sidesite` of tendon 'round' for one of the geom's own body: put it there, or use impl='warp'",
    ),
    "activation of RK4": (
        of(actuator=EXACT).replace("<worldbody>", OFF),
        of(actuator=EXACT.replace("exact", "")).replace("<worldbody>", OFF),
        ("warp",),
        "steps the activation of actuator 'm' otherwise than MuJoCo with the integrator RK4: ",
    ),
}
"""MJCF, the same without what is done otherwise, where, and what is said."""


@pytest.mark.parametrize("case", OTHERWISE)
def test_otherwise_is_refused(case):
    xml, _, impls, said = OTHERWISE[case]
    for impl in ("jax", "warp"):
        arena = mja.Arena.from_xml(xml)
        if impl not in impls:
            arena.put_model(impl)
            continue
        with pytest.raises(ValueError, match=f"^impl='{impl}' of MJX {re.escape(said)}"):
            arena.put_model(impl)


@pytest.mark.xslow
@pytest.mark.parametrize("case", OTHERWISE)
def test_mjx_does_otherwise(case):
    xml, without, impls, _ = OTHERWISE[case]
    held(xml, without, impls)


@pytest.mark.filterwarnings("ignore:`ranges` gives few valid worlds")
def test_limits_that_vary():
    """Worlds in which limits meet are flagged, with a sentence; C MuJoCo simulates them."""
    arena = mja.Arena.from_xml(
        of(
            joint='limited="true" range="-20 90"',
            tendon='limited="true" range="-1 1" margin=".5"',
        )
        .replace('name="b" axis', 'name="b" type="ball" limited="true" range="0 60" axis')
        .replace('<joint joint="b" coef="-1"/>', '<joint joint="x" coef="-1"/>')
    )
    arena.vary(
        high=mja.dr.Term("joint.range", ["a"], axes="high"),
        margin=mja.dr.Term("joint.margin", ["b", "a"]),
        tendon=mja.dr.Term("tendon.range", ["t"]),
    )
    ranges = mja.ArenaRanges(
        terms={
            "high": mja.Uniform(0.1, 1.0),
            "margin": mja.Uniform(0.0, 0.9),
            "tendon": mja.Uniform([-0.9, 0.2], [-0.2, 0.9]),
        }
    )
    n = 200
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), n), ranges)
    low, high = np.moveaxis(np.asarray(batch.model.jnt_range[:, :2]), -1, 0)
    margin, tendon = np.asarray(batch.model.jnt_margin), np.asarray(batch.model.tendon_range[:, 0])
    meet = [high[:, 0] - low[:, 0] < 2 * margin[:, 0], tendon[:, 1] - tendon[:, 0] < 2 * 0.5]
    assert all(20 < one.sum() < n - 20 for one in meet)
    np.testing.assert_array_equal(batch.valid, ~(meet[0] | meet[1]))
    for i in range(0, n, 10):
        first = "joint 'a'" if meet[0][i] else "tendon 't'"
        said = [
            f"The `margin` of {first} is more than half of its `range`: MJX holds only one of its limits at a time."
        ]
        assert arena.problems(batch.world(i)) == ([] if batch.valid[i] else said)
    arena.c_world(batch.world(int(np.argmin(batch.valid))))


def at_base(sensor):
    """SCENE under RK4, with a frame sensor of a site that no joint moves."""
    site = '<worldbody><site name="base" pos=".1 .2 .3"/>'
    return of(option='integrator="RK4"').replace("<worldbody>", site).replace('<jointvel name="s" joint="a" />', sensor)


SPRING_OFF = '<option><flag spring="disable"/></option><worldbody>'
BOTH_OFF = '<option density="500"><flag spring="disable" damper="disable"/></option><worldbody>'
YIELDS = hasattr(mujoco.MjModel, "jnt_springyield")  # MuJoCo 4
NOTHING_LEFT_OUT = {
    "no actuator of the group": SPRUNG.replace("<worldbody>", '<option actuatorgroupdisable="3"/><worldbody>'),
    "no activation": SPRUNG.replace("<general", '<general actearly="true"'),
    **({"no springs": of(joint='springyield=".1"', tendon='springyield=".1"')} if YIELDS else {}),
    "no sensors": of(sensor='delay=".01" nsample="6"').replace("<worldbody>", OFF),
    "nothing touches": SPRUNG.replace(
        "<worldbody>", '<worldbody><geom size=".1" surfacevel=".5 0 0 0 0 0" adhesion="9" contype="0" conaffinity="0"/>'
    ),
    "nothing is dragged": of(option='density="2000"', floor='fluidshape="ellipsoid"').replace(
        "<worldbody>", '<worldbody><geom pos="0 0 -3" size=".1" fluidshape="ellipsoid"/>'
    ),
    "no springs, no dampers": of().replace("<worldbody>", SPRING_OFF),
    "both flags": of(joint='stiffness="50"')
    .replace("<worldbody>", BOTH_OFF)
    .replace('name="b"', 'name="b" gravcomp=".5"', 1),
    "limits that do not meet": of(joint='limited="true" range="0 40" margin=".349" solreflimit=".1 1"'),
    "wind alone": of(option='wind="9 0 0"', ball='fluidshape="ellipsoid"'),
    "wind alone, no springs": of(option='wind="9 0 0"').replace("<worldbody>", SPRING_OFF),
    "RK4 and a camera at rest": looking('mode="targetbody" target="post"'),
    "side in the body": beside("", '<site name="side" pos="0 .1 0"/>'),
    "RK4 at rest": at_base('<framepos name="s" objtype="site" objname="base"/>'),
    "RK4 without sensors": of(actuator='dyntype="filter" dynprm=".01"').replace("<worldbody>", OFF),
}


@pytest.mark.parametrize("case", NOTHING_LEFT_OUT)
def test_taken(case):
    """What changes nothing is no reason to refuse a model."""
    xml = NOTHING_LEFT_OUT[case]
    assert xml != SPRUNG
    for impl in ("jax", "warp"):
        mja.Arena.from_xml(xml).put_model(impl)


@pytest.mark.parametrize(
    ("xml", "term", "said"),
    [
        (of(joint='springyield=".1"'), "joint.stiffness", "leaves out the `springyield` of joint 'a'"),
        (of().replace("<worldbody>", SPRING_OFF), "joint.damping", "takes the flags `spring` and `damper` for one"),
    ][not YIELDS :],
)
def test_refused_where_it_varies(xml, term, said):
    """What has no effect nominally, and can have one in a world."""
    arena = mja.Arena.from_xml(xml)
    arena.vary(a=mja.dr.Term(term, ["a"]))
    with pytest.raises(ValueError, match=said):
        arena.put_model("jax")


FEW = ("no activation", "limits that do not meet", "wind alone")  # of an actuator, of limits, of a fluid


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=[pytest.mark.xslow] * (case not in FEW)) for case in NOTHING_LEFT_OUT]
)
def test_taken_as_in_c(case):
    held(NOTHING_LEFT_OUT[case], SPRUNG.replace('stiffness="50" damping=".5"', 'stiffness="90" damping="2"'), ())


def moved(xml):
    """(n, nv + nsensordata) velocities and what is sensed in C."""
    model = mujoco.MjModel.from_xml_string(xml)
    c, found = mujoco.MjData(model), []
    c.ctrl[:], c.qvel[:] = 0.7, QVEL
    for _ in range(STEPS):
        mujoco.mj_step(model, c)
        found.append(np.concatenate([c.qvel, c.sensordata]))
    return np.array(found)


QVEL, STEPS = np.array([1, -0.5, 0.3, 0.01]), 10


def held(xml, without, impls):
    """MJX itself takes the model without a word: on `impls` it misses much of what C feels, elsewhere it feels the same."""
    model, want = mujoco.MjModel.from_xml_string(xml), moved(xml)
    other = moved(without)
    same = min(want.shape[1], other.shape[1])  # sensors differ in size, too
    effect = np.abs(want[:, :same] - other[:, :same]).max()
    for impl in ("jax", "warp"):
        one, data = mjx.put_model(model, impl=impl), mjx.make_data(model, impl=impl)
        data = data.replace(ctrl=jnp.full(model.nu, 0.7), qvel=jnp.asarray(QVEL, jnp.float32))
        step, got = jax.jit(mjx.step), []
        for _ in range(STEPS):
            data = step(one, data)
            got.append(np.concatenate([data.qvel, data.sensordata]))
        off = np.abs(np.array(got) - want).max() / effect
        assert off > 0.1 if impl in impls else off < 0.02, (impl, off, effect)


@pytest.mark.xslow
@pytest.mark.parametrize("case", [case for case in CASES if case != UNFELT], ids="-".join)
def test_mjx_is_otherwise(case):
    (row,) = (one for one in ELEMENTS if (one.kind, one.attribute) == case)
    xml, own = scene(case), CASES[case]
    plain = re.sub(r'(stiffness|damping)="([\d.]+) [^"]*"', r'\1="\2"', own)  # without the higher powers
    plain = re.sub(r'(armature|delay|actearly|springyield|interval|surfacevel|adhesion|fluidshape)="[^"]*"', "", plain)
    plain = re.sub(r'damping="3"|nsample="\d"', "", plain)
    held(xml, xml.replace(own, plain), row.impls)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in OPTIONS if name not in ("noslip", "discrete")])
# Nothing slips here, and MJX on JAX says itself that it does not have `discrete`.
@pytest.mark.xslow
def test_mjx_has_other_options(name):
    held(of_option(name), SPRUNG, OPTIONS[name][1])


ELSEWHERE = {
    r"(body|geom|site|jnt|tendon|actuator|cam|sensor)_user": "numbers of the user",
    r"(jnt|site|tendon|skin|flex)_group|.*_rgba|.*_matid|tendon_width|skin_.*|light_(bulbradius|intensity|range|softness|texid)"
    r"|mat_(metallic|roughness|reflectance|texrepeat|texuniform)|geom_castshadow|tex_colorspace|cam_(ipd|output)": "what is drawn",
    r"cam_projection|light_(body|targetbody)id": "what is drawn, on JAX by nothing",
    r"(name|names|numeric|text|plugin)_.*|.*_pathadr|.*_contenttypeadr|.*_plugin|plugin": "names, files and plugins",
    r"[BDM]_(colind|diag|rowadr|rownnz)|mapD2M|mapM2[DM]|ten_J_.*|flexedge_J_.*|efm0_.*|efmC_perm": "the layout of matrices",
    r"(bvh|oct)_.*|body_bvh.*|mesh_(extrema|facenormal|facenum|facetexcoord|poly.*|scale)": "what contacts are found with",
    r"flex.*": "flexes, which put_model refuses on JAX, and on Warp where it leaves out something",
    r"tree_.*|tendon_tree(id|num)|dof_length": "trees, for sleeping, which put_model refuses",
    r"actuator_(ctrladr|ctrlnum|ctrlspec|outadr|outnum)": "actuators with several numbers, which put_model refuses",
    r"actuator_length0|actuator_history(adr)?|sensor_history(adr)?|jnt_actuatorid|tendon_actuatorid|site_dataid|tendon_type": "derived",
    r"(jnt|tendon|key)_plastic(adr)?": "the state of what has a `springyield`",
    r"sensor_noise": "a number of the user, which no step adds",
}  # fmt: skip
"""Fields of `MjModel` that `mjx.Model` lacks, and why nothing is left out with them."""
REFUSED = {
    "actuator_armature", "actuator_damping", "actuator_dampingpoly", "actuator_delay", "jnt_springyield", "tendon_springyield",
    "geom_surfacevel", "geom_adhesion", "pair_adhesion", "sensor_delay", "sensor_interval",
}  # fmt: skip
"""Those that `put_model` refuses."""


@pytest.mark.parametrize("impl", ["jax", "warp"])
def test_nothing_else(impl):
    """Each field of a compiled model is in MJX's, is refused, or has a reason; a field that MuJoCo adds is noticed."""
    model = mujoco.MjModel.from_xml_string(scene(("joint", "damping")))
    of_impl = types.ModelJAX
    if impl == "warp":
        from mujoco.mjx.warp.types import ModelWarp as of_impl
    known = {one.name for one in (*types.Model.fields(), *of_impl.fields())}
    names = {n for n in dir(model) if not n.startswith("_") and isinstance(getattr(model, n, None), np.ndarray)}
    assert len(names) > 400
    unknown = {n for n in names - known - REFUSED if not any(re.fullmatch(why, n) for why in ELSEWHERE)}
    assert unknown == set()


class Older:
    """A model of MuJoCo 3.17, which has no springs that give way."""

    def __init__(self, model):
        self.model = model

    def __getattr__(self, name):
        if name.endswith("_springyield"):
            raise AttributeError(name)
        return getattr(self.model, name)


@pytest.mark.parametrize("n", [0, 3])
def test_of_an_older_mujoco(n):
    """Its joints are taken, however many there are."""
    body = '<body><joint stiffness="1" axis="0 1 0"/><geom size=".1"/></body>' * n
    left_out.check(Older(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")), "jax")
