"""Worlds against edits of the MJCF as it was given, compiled by MuJoCo alone: what `vary` writes into `arena.spec` cannot hide there."""

import re

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.terms.attributes import ATTRIBUTES

ROUNDED = 8 * 2.0**-23  # a few roundings of a number, relative to it
BODY = '<body name="{0}" pos="{1} 0 1"><joint name="j{0}" axis="0 1 0"/><geom size=".02"/></body>'
SCENE = """<mujoco>{top}<worldbody><body name="free" pos="0 0 1"><freejoint/><geom size=".1"/></body>
<body name="arm" pos=".3 0 1"><joint axis="0 1 0"/><geom type="capsule" size=".03 .2"/>{hung}</body>{stands}</worldbody>{more}</mujoco>"""
BARE = '<body name="it" pos="1 .5 .5" quat=".8 .6 0 0">{}</body>'
MASSLESS = {
    "nothing": {"stands": BARE.format("")},
    "at the origin": {"stands": '<body name="it"><geom size=".1" mass="0"/></body>'},
    "a geom without mass": {"stands": BARE.format('<geom size=".1" mass="0"/>')},
    "mocap": {"stands": BARE.format("").replace("<body", '<body mocap="true"')},
    "another group": {
        "top": '<compiler inertiagrouprange="0 2"/>',
        "stands": BARE.format('<geom size=".1" group="3"/>'),
    },
    "an end that is held": {
        "hung": BARE.format('<camera mode="trackcom"/>'),
        "more": '<equality><connect body1="it" body2="free" anchor="0 0 0"/></equality>',
    },
    "its own inertial": {
        "stands": BARE.format('<inertial mass="0" pos=".1 .2 .3" quat="1 0 0 0" diaginertia="0 0 0"/>')
    },
}


def scene(**parts):
    return SCENE.format(**{**dict.fromkeys(("top", "hung", "stands", "more"), ""), **parts})


@pytest.mark.parametrize("kind", MASSLESS)
def test_bodies_without_mass(kind):
    """MuJoCo puts the inertial of a body without mass where the body is, in all worlds."""
    xml = scene(**MASSLESS[kind])
    arena = mja.Arena.from_xml(xml)
    arena.vary(pos=dr.Term("body.pos", "it"), rpy=dr.Term("body.rpy", "it"))
    ranges = mja.ArenaRanges(
        terms={"pos": mja.Uniform(-0.5, 0.5, relative="add"), "rpy": mja.Uniform(-0.5, 0.5)}  # [m], [rad]
    )
    batch = arena.randomize(arena.put_model("jax"), mja.world_keys(0, range(3)), ranges)
    recompiled = {}
    for w in range(3):
        made, spec = arena.compile(batch.world(w)), mujoco.MjSpec.from_string(xml)
        element, at = spec.body("it"), made.body("it")
        element.pos, element.quat = at.pos, at.quat
        recompiled[w] = spec.compile()
        for name in ("body_ipos", "body_iquat", "body_invweight0", "cam_poscom0", "body_sameframe"):
            ours, theirs = getattr(made, name), getattr(recompiled[w], name)
            np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=1e-14, err_msg=name)
        assert not np.allclose(at.pos, arena.mj_model.body("it").pos)
    told = mja.differences(batch.model, recompiled)
    assert max(told.values(), default=0.0) < ROUNDED, told


INERTIAL = '<body name="it"><inertial mass="0" pos="0 0 0" diaginertia="0 0 0"/></body>'
FRAME = '<frame pos="0 0 .2">{}</frame>'
UNCLEAR = {
    "`arena.spec` must have no <inertial> without mass where its body is, got that of body 'it': leave it out, and the": INERTIAL,
    "cannot vary, as it has no mass and is in a <frame>, which `attach` makes of a pose: take": FRAME.format(
        BARE.format("")
    ),
}


@pytest.mark.parametrize("why", UNCLEAR)
def test_inertials_without_mass_that_are_refused(why):
    """One that cannot be told from the one that the compiler makes, and one that the compiler makes of numbers in a frame."""
    arena = mja.Arena.from_xml(scene(stands=UNCLEAR[why]))
    with pytest.raises(ValueError, match=re.escape(why)):
        arena.vary(pos=dr.Term("body.pos", "it"))


@pytest.mark.parametrize("attribute", ["body.mass", "body.mass_alone", "body.inertia"])
def test_inertials_of_aligned_bodies(attribute):
    """The compiler moves the frame of such a body, in which its inertial would be written."""
    box = '<body name="it"><freejoint align="true"/><geom type="box" size=".1 .05 .02" pos=".1 0 0"/></body>'
    arena = mja.Arena.from_xml(scene(stands=box))
    with pytest.raises(ValueError, match=r"the body is free and aligned with its inertia"):
        arena.vary(it=dr.Term(attribute, "it"))


ADDED = {
    "a geom is added": ("body.mass", lambda spec: spec.body("it").add_geom(size=(0.1, 0, 0), pos=(0, 0, 0.3), mass=5)),
    "a density": ("body.ipos", lambda spec: setattr(spec.geom("box"), "density", 1003)),
    "a size": ("body.payload", lambda spec: setattr(spec.geom("box"), "size", (0.1, 0.05, 0.02006))),
    "a place": ("body.inertia", lambda spec: setattr(spec.geom("box"), "pos", (0, 0, 0.001))),
    "the size of a geom": ("geom.mass", lambda spec: setattr(spec.geom("box"), "size", (0.1, 0.05, 0.02006))),
}


@pytest.mark.parametrize("case", ADDED)
def test_geoms_edited_after_vary(case):
    """A body keeps the inertial that a term has read, and so no geom of which it was made may become another one by 0.3 %."""
    attribute, edit = ADDED[case]
    box = '<body name="it"><joint axis="0 1 0"/><geom name="box" type="box" size=".1 .05 .02"/></body>'
    arena = mja.Arena.from_xml(scene(stands=box))
    arena.vary(it=dr.Term(attribute, "box" if attribute == "geom.mass" else "it"))
    edit(arena.spec)
    of = "geom 'box' weighs" if attribute == "geom.mass" else "the geoms of body 'it' weigh"
    with pytest.raises(ValueError, match=f"what {of} was edited after `arena.vary\\(it=...\\)` had read it"):
        arena.mj_model  # noqa: B018


@pytest.mark.parametrize("attribute", ["body.mass", "geom.mass"])
def test_edited_before_vary_and_saved(attribute, tmp_path):
    """The MJCF beside the file has the body's inertial, and no longer what geoms weigh: nothing counts as edited in it."""
    more = '<body name="it"><joint axis="0 1 0"/><geom name="box" type="box" size=".1 .05 .02" density="800"/>{}</body>'
    arena = mja.Arena.from_xml(scene(stands=more.format('<geom name="tip" size=".02" pos=".1 0 0"/>')))
    arena.spec.geom("tip").friction = (0.3, 0.1, 0.1)
    arena.vary(it=dr.Term(attribute, "it" if attribute == "body.mass" else "box"))
    mja.save(tmp_path / "arena.yaml", arena)
    again = mja.load(tmp_path / "arena.yaml")[0]
    params = [jax.tree.map(np.asarray, a.nominal_params()) for a in (arena, again)]
    for a, b in zip(*(a.terms["it"] for a in params), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6)
    one, other = (
        a.compile(p._replace(terms={"it": p.terms["it"] * 1.5})) for a, p in zip((arena, again), params, strict=True)
    )
    np.testing.assert_allclose(other.body_mass, one.body_mass, rtol=1e-12)
    assert other.geom("tip").friction.tolist() == [0.3, 0.1, 0.1]


EDITS = {
    "body.mass": ("it", lambda spec: setattr(spec.geom("box"), "density", 803)),
    "geom.friction": ("box", lambda spec: setattr(spec.geom("box"), "friction", (0.7, 0.1, 0.1))),
    "geom.size": ("box", lambda spec: setattr(spec.geom("box"), "size", (0.031, 0, 0))),
}


@pytest.mark.parametrize("attribute", EDITS)
def test_edits_that_a_term_read(attribute, tmp_path):
    """The calls in a file would read the numbers of before."""
    arena = mja.Arena.from_xml(
        scene(stands='<body name="it"><joint axis="0 1 0"/><geom name="box" size=".03" density="800"/></body>')
    )
    name, edit = EDITS[attribute]
    edit(arena.spec)
    arena.vary(it=dr.Term(attribute, name))
    with pytest.raises(
        ValueError, match=r"`arena`: `arena.spec` was edited before a term read the same numbers, which the calls"
    ):
        mja.save(tmp_path / "arena.yaml", arena)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("attribute", ["body.mass", "body.ipos"])
def test_edited_after_it_was_loaded(attribute, tmp_path):
    """What the MJCF beside a file tells of geoms still counts: a body would keep the mass of before."""
    geoms = '<geom name="box" size=".03" density="800"/><geom name="tip" size=".02" pos=".1 0 0"/>'
    arena = mja.Arena.from_xml(scene(stands=f'<body name="it"><joint axis="0 1 0"/>{geoms}</body>'))
    arena.spec.geom("tip").friction = (0.3, 0.1, 0.1)
    arena.vary(it=dr.Term(attribute, "it"))
    mja.save(tmp_path / "arena.yaml", arena)
    again = mja.load(tmp_path / "arena.yaml")[0]
    again.spec.geom("tip").density = 1003
    with pytest.raises(ValueError, match=r"what the geoms of body 'it' weigh was edited after `arena.vary\(it=...\)`"):
        again.mj_model  # noqa: B018


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
def test_all_weighed_anew_after_vary():
    box = '<body name="it"><joint axis="0 1 0"/><geom name="box" type="box" size=".1 .05 .02"/></body>'
    arena = mja.Arena.from_xml(scene(stands=box))
    arena.vary(it=dr.Term("body.ipos", "it"))
    arena.spec.compiler.settotalmass = 3
    with pytest.raises(ValueError, match="settotalmass"):
        arena.mj_model  # noqa: B018


@pytest.mark.parametrize("given", ["", 'springlength="0.2 0.2"', 'springlength="-0.1 0.5"', 'springlength="-1 0.5"'])
def test_tendons_edited_after_vary(given):
    """The length at rest is measured where the sites are, unless the MJCF gives it."""
    ends = '<body name="it"><joint axis="0 1 0"/><geom size=".1"/><site name="end" pos=".3 0 0"/></body><site name="start"/>'
    tendon = (
        f'<tendon><spatial name="t" stiffness="9" {given}><site site="start"/><site site="end"/></spatial></tendon>'
    )
    arena = mja.Arena.from_xml(scene(stands=ends, more=tendon))
    arena.vary(it=dr.Term("tendon.springlength", "t"))
    arena.spec.site("end").pos = (0.301, 0, 0)
    if given:
        assert arena.mj_model.tendon_lengthspring.tolist() == [[*map(float, given[14:-1].split())]]
        return
    with pytest.raises(ValueError, match=r"the length at rest of tendon 't' was edited after `arena.vary\(it=...\)`"):
        arena.mj_model  # noqa: B018


@pytest.mark.parametrize("attribute", ["body.mass", "geom.mass", "geom.density"])
def test_geoms_that_weigh_nothing_after_vary(attribute):
    """They may come, and so may what has an inertial of its own."""
    box = '<body name="it"><joint axis="0 1 0"/><geom name="box" type="box" size=".1 .05 .02"/></body>'
    arena = mja.Arena.from_xml(scene(stands=box))
    arena.vary(it=dr.Term(attribute, "it" if attribute == "body.mass" else "box"))
    arena.spec.body("it").add_geom(size=(0.1, 0, 0), pos=(0, 0, 0.3), mass=0)
    assert arena.mj_model.body("it").mass == pytest.approx(0.8, rel=1e-12)


KEYED = '<keyframe><key name="k" qpos="{}"/></keyframe>'
FRAMED = '<frame pos="0 0 1" axisangle="0 0 1 20">{}</frame>'
JOINTS = '<joint name="{0}" axis="0 {1} {2}" pos=".1 0 0"/>'
ORDERS = {
    "two frames": ("body.pos", "a", FRAMED.format(BODY.format("a", 0)) + FRAMED.format(BODY.format("b", 1))),
    "one frame": ("body.pos", "a", FRAMED.format(BODY.format("a", 0) + BODY.format("b", 1))),
    "one between": (
        "body.rpy",
        "a",
        FRAMED.format(BODY.format("a", 0)) + BODY.format("c", 2) + FRAMED.format(FRAMED.format(BODY.format("b", 1))),
    ),
    "joints": (
        "joint.axis",
        "ja",
        '<body name="a">'
        + FRAMED.format(JOINTS.format("ja", 1, 0) + JOINTS.format("jb", 0, 1))
        + '<geom pos=".2 0 0" size=".1"/></body>',
    ),
}


TWO_IN_A_FRAME = FRAMED.format(BODY.format("a", 0) + BODY.format("b", 1))


@pytest.mark.parametrize("rules", ['angle="radian"', 'angle="degree"', 'angle="radian" eulerseq="zyx"'])
@pytest.mark.parametrize("turn", ['euler="0.3 1.2 0.5"', 'axisangle="0 1 1 1.2"', 'zaxis="0 1 2"'])
@pytest.mark.parametrize("own", ["radian", "degree"])
def test_frames_of_other_rules(own, turn, rules):
    """A frame of an attached MJCF has the angles of its own <compiler>, also where a world's MJCF gives it anew."""
    robot = f"<mujoco><compiler {rules}/><worldbody>{TWO_IN_A_FRAME}</worldbody></mujoco>"
    arena = mja.Arena.from_xml(f'<mujoco><compiler angle="{own}"/><worldbody/></mujoco>')
    arena.attach(robot.replace('axisangle="0 0 1 20"', turn), "r_", pos=(0, 0, 1))
    arena.vary(q=dr.Term("body.pos", "r_a"))
    params = arena.nominal_params()
    alone = mujoco.MjModel.from_xml_string(robot.replace('axisangle="0 0 1 20"', turn))
    written = mujoco.MjModel.from_xml_string(arena.to_xml(params))
    for model, up in ((arena.compile(params), (0, 0, 1)), (written, (0, 0, 1))):
        np.testing.assert_allclose(model.body("r_b").pos, alone.body("b").pos + up, rtol=0, atol=1e-12)
        np.testing.assert_allclose(model.body("r_b").quat, alone.body("b").quat, rtol=0, atol=1e-12)


def test_what_is_between_two_of_a_frame():
    """MuJoCo writes what is in a frame at once: a body that was added in between would come after it."""
    spec = mujoco.MjSpec()
    frame = spec.worldbody.add_frame(pos=(0, 0, 1))
    for name, within in (("a", frame), ("between", None), ("b", frame)):
        body = spec.worldbody.add_body(name=name, pos=(ord(name[0]), 0, 1))
        if within is not None:
            body.set_frame(within)
        body.add_joint(name=f"j{name}", axis=(0, 1, 0))
        body.add_geom(size=(0.1, 0, 0))
    arena = mja.Arena.from_xml(spec)
    written = mujoco.MjModel.from_xml_string(arena.to_xml(arena.nominal_params()))
    assert [written.joint(i).name for i in range(3)] == ["ja", "jbetween", "jb"]


def test_attached_without_mass():
    """The frame in which `attach` puts what has no pose changes nothing, and so does not keep a body without mass from moving."""
    arena = mja.TableArena()
    arena.attach('<mujoco><worldbody><body name="it" mocap="true" pos="1 0 1"/></worldbody></mujoco>', "r_")
    arena.vary(pos=dr.Term("body.pos", "r_it"))
    ranges = mja.ArenaRanges(terms={"pos": mja.Uniform(0.1, 0.2, relative="add")})
    world = arena.sample_params(jax.random.key(0), ranges)
    got = arena.compile(world).body("r_it")
    np.testing.assert_array_equal(got.ipos, got.pos)
    assert (got.pos - [1, 0, 1] > 0.09).all()


@pytest.mark.parametrize("case", ORDERS)
def test_order_in_files(case):
    """The MJCF of a world lists joints as its model has them, and so gives each what a keyframe says."""
    attribute, name, stands = ORDERS[case]
    n = 1 + stands.count("joint")
    keyed = KEYED.format(" ".join(["0 0 1 1 0 0 0", *(str(0.1 * i) for i in range(n))]))
    arena = mja.Arena.from_xml(scene(stands=stands, more=keyed))
    arena.vary(it=dr.Term(attribute, name))
    params = arena.nominal_params()
    made, written = arena.compile(params), mujoco.MjModel.from_xml_string(arena.to_xml(params))
    assert [made.joint(i).name for i in range(made.njnt)] == [written.joint(i).name for i in range(made.njnt)]
    ours, theirs = (mujoco.MjData(one) for one in (made, written))
    for model, data in ((made, ours), (written, theirs)):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
    np.testing.assert_allclose(ours.geom_xpos, theirs.geom_xpos, atol=1e-12)
    np.testing.assert_allclose(ours.qpos, theirs.qpos)


def test_keyframes_of_mocap_bodies_in_c_batch():
    """A keyframe that leaves out where mocap bodies are has them where each world has them."""
    keys = '<keyframe><key name="own" mpos="0 0 3"/><key name="left out" qvel="1 0 0 0 0 0 0"/></keyframe>'
    xml = scene(stands='<body name="it" mocap="true" pos="1 1 1"><geom size=".05"/></body>', more=keys)
    arena = mja.Arena.from_xml(xml)
    arena.vary(pos=dr.Term("body.pos", "it"), rpy=dr.Term("body.rpy", "it"))
    ranges = mja.ArenaRanges(terms={"pos": mja.Uniform([1, 1, 1], [2, 2, 2]), "rpy": mja.Uniform(-0.5, 0.5)})
    seeds = mja.world_keys(0, range(2))
    batch = arena.randomize(arena.put_model("jax"), seeds, ranges)
    cpu = arena.c_batch(batch.params, keys=seeds)
    for w in range(2):
        ours, theirs = cpu.get_model(w), arena.compile(batch.world(w))
        for name in ("key_mpos", "key_mquat", "key_qpos"):
            np.testing.assert_allclose(
                getattr(ours, name), getattr(theirs, name), rtol=ROUNDED, atol=1e-7, err_msg=name
            )
        assert not np.allclose(theirs.key_mpos[0], theirs.key_mpos[1])


def test_the_nominal_model_stays(monkeypatch):
    """What `vary` writes into a spec is compared with the model before: without the rule for aligned bodies, this refuses them, too."""
    row = ATTRIBUTES["body.mass"]._replace(refused_in_spec=None)
    monkeypatch.setitem(ATTRIBUTES, "body.mass", row)
    box = '<body name="it"><freejoint align="true"/><geom type="box" size=".1 .05 .02" pos=".1 0 0"/></body>'
    arena = mja.Arena.from_xml(scene(stands=box))
    with pytest.raises(ValueError, match=r"^`arena\.spec`: what `vary` writes into it would change body_pos, .*qpos0"):
        arena.vary(it=dr.Term("body.mass", "it"))
