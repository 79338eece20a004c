"""Robots with simpler shapes: what MuJoCo fits, how far that is from the meshes, and all that stays as it was."""

import functools
import math
import pathlib
import re
import time

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.robots import convex, fitting

RNG = np.random.default_rng(0)
ROD = RNG.uniform(-1, 1, (60, 3)) * [0.03, 0.04, 0.12] + [0.01, 0, 0.1]
BLOCK = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * [0.03, 0.05, 0.02]
BALL = (lambda v: 0.04 * v / np.linalg.norm(v, axis=1, keepdims=True))(RNG.normal(size=(80, 3)))
MESHES = {"rod": ROD, "block": BLOCK, "ball": BALL}


def vertices(points):
    return " ".join(f"{x:.9g}" for x in np.ravel(points))


ARM = f"""<mujoco><compiler {{compiler}}/><option timestep=".004"/>
<default><default class="hit"><geom group="3"/></default></default>
<asset>{"".join(f'<mesh name="{name}" vertex="{vertices(points)}"/>' for name, points in MESHES.items())}
  <mesh name="look" vertex="{vertices(BLOCK)}"/></asset>
<worldbody><body name="base"><geom name="foot" type="mesh" mesh="block"/>
  <body name="upper" pos="0 0 .15" euler="0 .3 0"><joint name="a" axis="0 1 0" range="-1 1"/>
    <frame pos=".01 0 0" euler=".1 .2 .3"><geom class="hit" type="mesh" mesh="rod" euler="0 .2 0" pos="0 .01 0"/></frame>
    <geom type="mesh" mesh="look" contype="0" conaffinity="0" group="2" density="0"/>
    <geom name="mark" type="sphere" size=".01" contype="0" conaffinity="0" group="4"/>
    <body name="lower" pos="0 0 .4"><joint name="b" axis="0 1 0" range="-2 2"/><inertial pos="0 0 .1" mass="1" diaginertia=".01 .02 .02"/>
      <geom class="hit" name="lower" type="mesh" mesh="rod"/><site name="s1" pos="0 .2 0"/><site name="s2" pos="0 -.2 0"/>
      <body name="hand" pos="0 0 .3"><joint name="c" axis="1 0 0"/><geom class="hit" type="mesh" mesh="ball" mass=".3"/>
        <body name="left" pos="0 .06 .08"><joint name="d" type="slide" axis="0 1 0"/>
          <geom name="left_tip" type="mesh" mesh="block"/></body>
        <body name="right" pos="0 -.06 .08"><joint name="e" type="slide" axis="0 1 0"/>
          <geom name="right_tip" type="mesh" mesh="block"/></body>
      </body></body></body></body></worldbody>
<tendon><spatial name="t"><site site="s1"/><geom geom="mark"/><site site="s2"/></spatial></tendon>
<actuator><position name="pa" joint="a" kp="10"/><general name="pb" joint="b" dyntype="integrator"/>
  <general name="pc" joint="c" dyntype="filter"/></actuator>
<sensor><actuatorfrc name="fa" actuator="pa"/><jointpos name="qb" joint="b"/></sensor>
<keyframe><key name="home" qpos="0 .02 0 0 0" ctrl="1 2 3" act="4 5"/></keyframe></mujoco>"""
TIPS = ".*_tip"


def arm(compiler="", **kwargs):
    return mja.simplify(ARM.format(compiler=compiler), **kwargs)


@functools.cache
def original(compiler=""):
    return mujoco.MjModel.from_xml_string(ARM.format(compiler=compiler))


def to_mesh(points, queries):
    """(n,) how far points are from the convex hull of others, as MuJoCo says [m]."""
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-9, 200
    mesh = spec.add_mesh(name="m", uservert=np.ravel(points))
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    spec.worldbody.add_body(mocap=True).add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-6, 0, 0])
    model = spec.compile()
    data, found = mujoco.MjData(model), []
    for query in queries:
        data.mocap_pos[0] = query
        mujoco.mj_kinematics(model, data)
        found.append(max(0.0, mujoco.mj_geomDistance(model, data, 0, 1, 1.0, None) + 1e-6))
    return np.array(found)


def to_shape(shape, queries):
    """(n,) how far points are from a sphere, capsule or box [m]."""
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, shape.quat)
    local = (queries - shape.pos) @ turn.reshape(3, 3)
    if shape.kind == "box":
        return np.linalg.norm(np.maximum(abs(local) - shape.size, 0), axis=1)
    half = shape.size[1] if shape.kind == "capsule" else 0
    local[:, 2] -= np.clip(local[:, 2], -half, half)
    return np.maximum(np.linalg.norm(local, axis=1) - shape.size[0], 0)


def surface(shape, n):
    """Points among which the farthest of a shape from any convex one is, and how far apart neighbours are [m]."""
    turn, z = np.zeros(9), 1 - (2 * np.arange(n) + 1) / n
    mujoco.mju_quat2Mat(turn, shape.quat)
    if shape.kind == "box":
        local, apart = BLOCK / abs(BLOCK).max(0) * shape.size, 0.0
    else:
        angle = np.pi * (3 - math.sqrt(5)) * np.arange(n)
        ball = np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
        half = shape.size[1] if shape.kind == "capsule" else 0
        local = shape.size[0] * ball + np.sign(z)[:, None] * [0, 0, half]
        apart = shape.size[0] * math.sqrt(4 * np.pi / n)
    return local @ turn.reshape(3, 3).T + shape.pos, apart


@pytest.mark.parametrize("kind", ["capsule", "box", "sphere", "hull"])
@pytest.mark.parametrize("mesh", MESHES)
def test_change_of_shape(mesh, kind):
    """It is the largest distance of a point of either convex shape from the other, by MuJoCo's distances and by formulas."""
    points = MESHES[mesh]
    spec = mujoco.MjSpec()
    spec.add_mesh(name="m", uservert=points.ravel()).inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="m")
    model = spec.compile()
    got = fitting.fitted(model, 0, [kind], 8)
    points = np.array(model.mesh_vert, float)
    if kind == "hull":  # of at most 8 of the points
        assert len(got.points) <= 8
        want, apart = to_mesh(got.points, points).max(), 0.0
        assert to_mesh(points, got.points).max() < 1e-6
    else:
        queries, apart = surface(got, 4000)
        want = max(to_shape(got, points).max(), to_mesh(points, queries).max())
    assert want - 2e-6 <= got.change <= want + apart + 2e-6  # MuJoCo's meshes have seven digits


def test_primitives_change_least():
    """A block becomes a box, exactly; a rod becomes a capsule or box, whichever is nearer; what is round has no capsule of its own."""
    model = original()
    meshes = {name: model.mesh(name).id for name in MESHES}
    of = {name: {k: fitting.fitted(model, i, [k], 8) for k in fitting.PRIMITIVES} for name, i in meshes.items()}
    assert of["block"]["box"].change < 1e-6
    for name, i in meshes.items():
        least = min(one.change for one in of[name].values())
        assert fitting.fitted(model, i, list(fitting.PRIMITIVES), 8).change == least
    _, report = arm(collision="primitive")
    assert {one.now for one in report.reshaped if one.geom in ("foot", "left_tip", "right_tip")} == {"box"}
    assert report.largest_change == max(one.change for one in report.reshaped)


# An L of unequal legs, whose own axes are not those of its convex hull.
OUTLINE = np.array([(0, 0), (0.2, 0), (0.2, 0.04), (0.05, 0.04), (0.05, 0.3), (0, 0.3)])
ELL = np.vstack([np.column_stack([OUTLINE, np.full(6, z)]) for z in (0, 0.05)])
CAPS = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4)]
FACES = [*CAPS, *((a + 6, c + 6, b + 6) for a, b, c in CAPS)]
FACES += [f for i in range(6) for f in ((i, (i + 1) % 6, (i + 1) % 6 + 6), (i, (i + 1) % 6 + 6, i + 6))]
BRACKET = f"""<mujoco><compiler fitaabb="{{}}"/><asset><mesh name="m" vertex="{vertices(ELL)}" face="{vertices(FACES)}"/>
  <mesh name="h" vertex="{vertices(ELL)}" inertia="convex"/></asset><worldbody><body name="b"><joint/>
  <geom name="g" type="mesh" mesh="m" pos=".1 .2 .3" euler="10 20 30"/><geom name="f" type="{{}}" mesh="h" pos=".1 .2 .3" euler="10 20 30"/>
  </body></worldbody></mujoco>"""


def in_body(model, name):
    """A geom as a convex shape in its body."""
    geom = model.geom(name)
    if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
        return convex.Convex(convex.placed(convex.hull(model, int(geom.dataid[0])), geom.pos, geom.quat), 0.0)
    return convex.primitive(geom.type[0], geom.size, geom.pos, geom.quat)


@pytest.mark.parametrize("kind", ["capsule", "box", "sphere", "hull"])
def test_the_nearer_fit_in_its_place(kind):
    """A turned mesh that is not convex: the shape is as far from it as the report says, and so is the nearer of MuJoCo's own two fits."""
    xml = BRACKET.format("false", "box")
    before = mujoco.MjModel.from_xml_string(xml)
    spec, report = mja.simplify(xml, collision=kind, hull=7)
    got = convex.distance(in_body(before, "g"), in_body(spec.compile(), "g"))
    assert got == pytest.approx(report.largest_change, abs=1e-6)
    if kind == "hull":
        return
    fits = [mujoco.MjModel.from_xml_string(BRACKET.format(aabb, kind)) for aabb in ("false", "true")]
    apart = [convex.distance(in_body(model, "g"), in_body(model, "f")) for model in fits]
    assert abs(apart[0] - apart[1]) > 1e-3
    assert got == pytest.approx(min(apart), abs=1e-6)


@pytest.mark.parametrize("kind", ["capsule", "hull"])
def test_names_and_defaults_of_the_robot(kind):
    """Of a robot that scales its meshes by default, and has names that new ones would have: the shape is as in the report."""
    xml = f"""<mujoco><default><mesh scale=".1 .1 .1" maxhullvert="9"/></default>
    <asset><mesh name="m" vertex="{vertices(10 * ROD)}"/><mesh name="m_hull" vertex="{vertices(10 * BLOCK)}"/></asset><worldbody><body>
    <joint/><geom name="g" type="mesh" mesh="m"/><geom name="g_visual" type="mesh" mesh="m_hull"/></body></worldbody></mujoco>"""
    before = mujoco.MjModel.from_xml_string(xml)
    spec, report = mja.simplify(xml, collision={"g": kind, "g_visual": "mesh"}, hull=30)
    after = spec.compile()
    got = convex.distance(in_body(before, "g"), in_body(after, "g"))
    assert got == pytest.approx(report.largest_change, abs=1e-6)
    assert got < 0.05
    assert convex.distance(in_body(before, "g_visual"), in_body(after, "g_visual")) < 1e-9
    assert after.geom("g_visual_").contype == 0


COMPILERS = ("", 'inertiafromgeom="true"', 'inertiagrouprange="0 3"', 'angle="radian"', 'settotalmass="7"')


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("collision", ["primitive", "hull", "none"])
def test_masses_and_names_stay(collision, compiler):
    """Bodies, joints and all that weighs are the original's, and so are accelerations where nothing touches."""
    before = original(compiler)
    spec, _ = arm(compiler, collision=collision, visual=False, options={})
    after = spec.compile()
    for field in (
        "body_mass",
        "body_inertia",
        "body_ipos",
        "body_iquat",
        "body_subtreemass",
        "body_invweight0",
        "dof_M0",
    ):
        np.testing.assert_allclose(getattr(after, field), getattr(before, field), rtol=1e-6, atol=1e-12, err_msg=field)
    for kind, count in (
        ("body", "nbody"),
        ("joint", "njnt"),
        ("actuator", "nu"),
        ("sensor", "nsensor"),
        ("key", "nkey"),
    ):
        names = [[getattr(m, kind)(i).name for i in range(getattr(m, count))] for m in (before, after)]
        assert names[0] == names[1]
    accelerations = []
    for model in (before, after):
        data = mujoco.MjData(model)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        accelerations.append(data.qacc.copy())
        model.opt.disableflags = 0
    np.testing.assert_allclose(*accelerations, rtol=1e-6)


@pytest.mark.parametrize(
    ("on", "more"),
    [
        ('<site name="s" type="mesh" mesh="pad"/>', ""),
        ("", '<sensor><tactile name="t" mesh="pad" geom="g"/></sensor>'),
        ("", '<custom><tuple name="t"><element objtype="mesh" objname="pad"/></tuple></custom>'),
    ],
)
def test_meshes_that_something_else_has(on, more):
    corners = 'vertex="0 0 0 .2 0 0 0 .3 0 0 0 .15"'
    xml = f"""<mujoco><asset><mesh name="m" {corners}/><mesh name="pad" {corners}/></asset><worldbody>
    <body name="b"><joint/><geom name="g" type="mesh" mesh="m"/>{on}</body></worldbody>{more}</mujoco>"""
    try:
        mujoco.MjModel.from_xml_string(xml)
    except ValueError:
        pytest.skip("this MuJoCo has none of these")
    spec, _ = mja.simplify(xml, visual=False)
    assert [mesh.name for mesh in spec.meshes] == ["pad"]


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
def test_what_would_change_is_refused():
    """Bounds of masses come before the total, and the compiler would use them again on what both have made."""
    corners = 'vertex="0 0 0 .2 0 0 0 .3 0 0 0 .15"'
    xml = f"""<mujoco><compiler settotalmass="1" boundmass=".6"/><asset><mesh name="m" {corners}/></asset><worldbody>
    <body name="a"><joint axis="0 1 0"/><geom type="mesh" mesh="m" mass="1"/><body name="b" pos=".3 0 0"><joint axis="0 1 0"/>
    <geom size=".05" mass=".1"/></body></body></worldbody></mujoco>"""
    with pytest.raises(
        ValueError, match=r"with simpler shapes MuJoCo would compile another body_inertia, body_mass\. If"
    ):
        mja.simplify(xml)


@pytest.mark.parametrize(
    "geom", ['type="plane" size="1 1 .1" pos="0 0 .1"', 'size=".1" mass="0"', 'size=".1" group="5"']
)
def test_inertials_that_no_geom_makes(geom):
    """The compiler keeps that of a body whose geoms weigh nothing, also where it makes all of geoms."""
    corners = 'vertex="0 0 0 .2 0 0 0 .3 0 0 0 .15"'
    xml = f"""<mujoco><compiler inertiafromgeom="true" inertiagrouprange="0 3"/><asset><mesh name="m" {corners}/></asset><worldbody>
    <body name="base" pos="3 0 0"><inertial pos=".5 0 0" mass="9" diaginertia="1 1 1"/><geom {geom}/>
    <body name="arm"><joint axis="0 1 0"/><geom type="mesh" mesh="m" mass="1"/></body></body></worldbody></mujoco>"""
    before, after = mujoco.MjModel.from_xml_string(xml), mja.simplify(xml)[0].compile()
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        np.testing.assert_allclose(getattr(after, field), getattr(before, field), rtol=1e-6, atol=1e-12, err_msg=field)


def test_inertials_that_the_compiler_overrules():
    """Those of bodies whose geoms stay, too, which another rule of the compiler would give back."""
    xml = """<mujoco><compiler inertiafromgeom="true"/><asset><mesh name="rod" vertex="0 0 0 .2 0 0 0 .3 0 0 0 .15"/></asset>
    <worldbody><body name="base"><joint name="a" axis="0 1 0"/><geom type="mesh" mesh="rod" mass="1"/>
    <body name="tip" pos=".3 0 0"><joint name="b" axis="0 1 0"/><inertial pos=".5 0 0" mass="9" diaginertia="1 1 1"/>
    <geom size=".05" mass=".4"/></body></body></worldbody></mujoco>"""
    before, after = mujoco.MjModel.from_xml_string(xml), mja.simplify(xml)[0].compile()
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        np.testing.assert_allclose(getattr(after, field), getattr(before, field), rtol=1e-6, atol=1e-12, err_msg=field)


@pytest.mark.parametrize("collision", ["capsule", "hull"])
def test_shapes_stand_where_the_meshes_stood(collision):
    """In frames and turned, too: each shape touches the box around its mesh as closely as its change allows."""
    before, data = original(), mujoco.MjData(original())
    mujoco.mj_forward(before, data)
    spec, report = arm(collision=collision, options={})
    after = spec.compile()
    new = mujoco.MjData(after)
    mujoco.mj_forward(after, new)
    changes = [one.change for one in report.reshaped]
    hits = [[g for g in range(m.ngeom) if m.geom_contype[g]] for m in (before, after)]
    assert len(hits[0]) == len(hits[1]) == len(changes) == 6
    axes = np.vstack([np.eye(3), -np.eye(3)])
    for old, one, change in zip(*hits, changes, strict=True):
        reach = [spread(m, d, g, axes) for m, d, g in ((before, data, old), (after, new, one))]
        np.testing.assert_allclose(*reach, rtol=0, atol=change + 1e-6)
        assert after.geom(one).name == before.geom(old).name
    again = mujoco.MjModel.from_xml_string(spec.to_xml())
    for field in ("geom_type", "geom_pos", "geom_quat", "geom_size", "geom_rbound"):
        np.testing.assert_allclose(getattr(again, field), getattr(after, field), rtol=0, atol=1e-5, err_msg=field)


def spread(model, data, geom, axes):
    """(n,) how far a mesh or capsule reaches along axes in the world."""
    turn, pos = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    points, more = np.array([[0, 0, 1], [0, 0, -1]]) * model.geom_size[geom, 1], model.geom_size[geom, 0]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(model.geom_dataid[geom])
        points, more = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]], 0.0
    return (axes @ (points @ turn.T + pos).T).max(1) + more


def types(model):
    return {
        model.geom(g).name or model.body(model.geom_bodyid[g]).name: mujoco.mjtGeom(model.geom_type[g]).name[7:]
        for g in range(model.ngeom)
        if model.geom_contype[g]
    }


def test_rules():
    """The first rule that matches a geom, its mesh or its body holds; `keep` before all; what none matches stays."""
    rules = {"upper": "box", "rod": "capsule", ".*_tip": "sphere", "ball": "none"}
    spec, report = arm(collision=rules, keep="left_tip")
    want = {"foot": "MESH", "upper": "BOX", "lower": "CAPSULE", "left_tip": "MESH", "right_tip": "SPHERE"}
    assert types(spec.compile()) == want
    assert [one.now for one in report.reshaped] == ["box", "capsule", "none", "sphere"]
    assert (report.before.colliding, report.after.colliding) == (6, 5)
    spec, report = arm(collision="mesh", options={})
    assert str(report) == str(arm(collision="primitive", keep=".*", options={})[1])
    assert report.reshaped == ()
    assert report.before == report.after


PAD = """<mujoco><compiler inertiagrouprange="{0}"/><asset><mesh name="m" vertex="-.1 -.1 -.1 .2 0 0 0 .1 0 0 0 .3"/></asset>
  <worldbody><body name="arm"><joint axis="0 1 0"/><geom type="box" size=".1 .1 .1" group="{1}" contype="0" conaffinity="0"/>
  <body name="pad" pos="0 0 .5"><geom name="pad" type="mesh" mesh="m" group="{2}" {3}/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(("groups", "own", "visual"), [("0 2", 3, False), ("3 5", 0, True)])
def test_bodies_without_mass_stay_so(groups, own, visual):
    """Also where the geom that collides comes into another group, of which the compiler would make an inertial."""
    text = PAD.format(groups, groups[0], own, "")
    before = mujoco.MjModel.from_xml_string(text)
    assert before.body("pad").mass == 0
    after = mja.simplify(text, visual=visual)[0].compile()
    np.testing.assert_array_equal(after.body_mass, before.body_mass)


@pytest.mark.parametrize(
    "turn", ['euler="90 0 30"', 'axisangle="0 1 1 50"', 'xyaxes="0 1 0 0 0 1"', 'zaxis="1 2 0"', 'quat="1 2 0 0"']
)
def test_what_is_drawn_stands_where_it_stood(turn):
    """However the MJCF says how a mesh is turned."""
    text = PAD.format("0 5", 0, 0, f'pos=".1 0 .2" {turn}')
    before, after = mujoco.MjModel.from_xml_string(text), mja.simplify(text, collision="box")[0].compile()
    poses = []
    for model, name in ((before, "pad"), (after, "pad_visual")):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        poses.append(np.concatenate([data.geom(name).xpos, data.geom(name).xmat]))
    np.testing.assert_allclose(*poses, rtol=0, atol=1e-9)


def test_what_is_drawn():
    """A mesh that was seen is drawn on, and the shape that collides is not; without `visual` only what is referred to stays."""
    before, (spec, report) = original(), arm(collision="capsule", keep=TIPS)
    model = spec.compile()
    assert report.after.drawn == before.ngeom - 6 + 1  # the foot
    foot, copy = model.geom("foot"), model.geom("foot_visual")
    assert (foot.group[0], copy.group[0], copy.contype[0]) == (3, 0, 0)
    assert copy.type == mujoco.mjtGeom.mjGEOM_MESH
    spec, report = arm(collision="capsule", visual=False)
    assert report.after.drawn == 1
    assert [geom.name for geom in spec.geoms if not geom.contype] == ["mark"]  # of the tendon
    assert {geom.group for geom in spec.geoms if geom.contype} == {0}  # all that is left of the robot is drawn
    assert {geom.name: geom.group for geom in spec.geoms}["mark"] == 4
    assert [mesh.name for mesh in spec.meshes] == []
    assert mujoco.MjModel.from_xml_string(spec.to_xml()).nmesh == 0


def test_actuators_that_go():
    """With them go their sensors and their numbers in keyframes."""
    spec, report = arm(actuators=["p[b-z]"])
    model = spec.compile()
    assert report.actuators == ("pa",)
    assert report.sensors == ("fa",)
    assert [model.actuator(i).name for i in range(model.nu)] == ["pb", "pc"]
    np.testing.assert_array_equal(model.key_ctrl, [[2, 3]])
    np.testing.assert_array_equal(model.key_act, [[4, 5]])
    spec, report = arm(actuators="pc")
    np.testing.assert_array_equal(spec.compile().key_act, [[5]])
    assert spec.compile().sensor(0).name == "qb"
    assert arm(actuators=[])[0].compile().nu == 0


def test_options():
    """They are set, and the report has those that differ."""
    elliptic = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec, report = arm(options={"iterations": 100, "timestep": 0.002, "cone": elliptic})
    assert report.options == {"timestep": (0.004, 0.002), "cone": (0, elliptic)}
    assert spec.compile().opt.cone == elliptic
    assert spec.option.timestep == 0.002
    assert arm(options={"cone": "elliptic"})[0].compile().opt.cone == elliptic
    assert arm()[0].option.iterations == mja.robots.FAST["iterations"]


def test_self_collisions():
    """Without them the fingertips alone may touch, and with them what did before."""
    spec, report = arm(self_collisions=False, keep=TIPS)
    assert report.after.pairs == 1
    assert (
        report.before.pairs == 6 * 5 / 2 - 4
    )  # but for a base that is fixed, parents and children touch nothing of each other
    assert ("left", "right") not in report.excluded
    assert arm(keep=TIPS)[1].after.pairs == report.before.pairs
    assert {(e.bodyname1, e.bodyname2) for e in spec.excludes} == set(report.excluded)


CROSS = f"""<mujoco><asset><mesh name="cross" vertex="{vertices(np.vstack([np.eye(3), -np.eye(3)]) * 0.1)}"/></asset><worldbody>
  <geom name="stone" type="box" size=".05 .05 .05" pos=".09 .09 .09"/>
  <body name="one"><joint axis="0 0 1"/><geom type="mesh" mesh="cross"/></body>
  <body name="two" pos=".11 .11 0"><joint axis="1 0 0"/><geom type="mesh" mesh="cross"/></body>
  <body name="three" pos="0 0 .05"><joint axis="1 0 0"/><geom size=".04"/></body></worldbody></mujoco>"""


def test_bodies_that_new_shapes_put_inside_each_other():
    """They get an exclude; what was inside each other before does not, nor what touches the world: the arena's, then."""
    spec, report = mja.simplify(CROSS, collision="sphere", options={})
    assert report.excluded == (("one", "two"),)
    arena = mja.TableArena(objects=[mja.Object("cube")])
    with pytest.warns(UserWarning, match="geoms are inside each other: .*'r_stone'"):
        arena.attach(spec, "r_", pos=(3, 0, 1))


PROBLEMS = {
    "`collision` must be one of 'primitive', 'capsule', 'box', 'sphere', 'hull', 'mesh', 'none', or a dictionary of these by "
    "names or regular expressions, got 'cylinder'.": {"collision": "cylinder"},
    "`collision`: no geom, mesh or body is called 'lowr', as a name or a regular expression: did you mean `lower`?": {
        "collision": {"lowr": "box"}
    },
    (
        "`keep`: no geom, mesh or body is called '(', nor is it a valid regular expression: missing ), unterminated "
        "subpattern at position 0."
    ): {"keep": "("},
    "`keep` must be a name, a regular expression or a list of them, got 3.": {"keep": 3},
    "`hull` must be a whole number >= 4, got 3.": {"hull": 3},
    "`actuators`: no actuator is called 'motor', as a name or a regular expression; known are pa, pb, pc.": {
        "actuators": "motor"
    },
    "`options`: MuJoCo has no option 'iteration': did you mean `iterations`?": {"options": {"iteration": 3}},
    "`options['iterations']` must be a number >= 1, got -3.": {"options": {"iterations": -3}},
    "`options['timestep']` must be a number > 0, got 0.": {"options": {"timestep": 0}},
    "`options['tolerance']` must be a number >= 0, got nan.": {"options": {"tolerance": float("nan")}},
    "`options['timestep']` must be a number, got 'fast'.": {"options": {"timestep": "fast"}},
    "`options` must be a dictionary of MuJoCo's options by name, got 3.": {"options": 3},
    "`options['solver']` must be one of pgs (0), cg (1), newton (2), got 7.": {"options": {"solver": 7}},
    "`options['cone']` must be one of pyramidal (0), elliptic (1), got 2.": {"options": {"cone": 2}},
    "`options['gravity']` must be 3 numbers, got [0, 0].": {"options": {"gravity": [0, 0]}},
    "`options['iterations']` must be a whole number, got 2.5.": {"options": {"iterations": 2.5}},
    "`options['cone']` must be one of pyramidal (0), elliptic (1), got 'eliptic'.": {"options": {"cone": "eliptic"}},
    "`measure` must be true or false, got 'yes'.": {"measure": "yes"},
    "`collision`: rule 'foot' decides nothing, as '.*' stands before it and matches the same geoms: put 'foot' first.": {
        "collision": {".*": "box", "foot": "capsule"}
    },
    "`options['gravity']` must be finite numbers, got (0, 0, nan).": {"options": {"gravity": (0, 0, float("nan"))}},
    "`options['iterations']` must be a number, got True.": {"options": {"iterations": True}},
}


@pytest.mark.parametrize("said", PROBLEMS)
def test_problems(said):
    """One sentence each."""
    with pytest.raises(ValueError) as error:  # noqa: PT011
        arm(**PROBLEMS[said])
    assert str(error.value) == said


def test_all_problems_at_once(tmp_path):
    """A robot that is none is told alone."""
    with pytest.raises(ValueError, match=r"^2 problems in simplify:\n- `hull` .*\n- `keep` "):
        arm(hull=3, keep=3)
    with pytest.raises(FileNotFoundError, match=r"^`robot`: there is no file 'nowhere.xml'\.$"):
        mja.simplify("nowhere.xml")
    with pytest.raises(IsADirectoryError, match=rf"^`robot` must be a file, got the folder '{tmp_path}'\.$"):
        mja.simplify(tmp_path)
    plane = "<mujoco><worldbody><geom type='plane' size='1 1 .1'/></worldbody></mujoco>"
    for nothing in (mujoco.MjSpec(), "<mujoco/>", plane):
        with pytest.raises(ValueError, match=r"^`robot` must have a body beside the world: it has none\.$"):
            mja.simplify(nothing)


def test_report_in_words():
    """What it says of an arm."""
    _, report = arm(
        collision={"rod": "mesh", ".*": "none"}, keep=["rod", "foot"], actuators=["pb", "pc"], options={"iterations": 7}
    )
    text = """pairs of geoms that may collide: 11 -> 2
geoms that collide: 6 -> 3
corners of their meshes: {before} -> {after}
geoms that are drawn only: 2 -> 4
3 x mesh that collides no more
actuators that are gone: pa
sensors that are gone: fa
options: iterations 100 -> 7"""
    assert str(report) == text.format(before=report.before.vertices, after=report.after.vertices)


def test_simplified_robot_in_an_arena():
    """It is attached, varied and proven like any other; the report is of the robot alone."""
    spec, _ = arm(collision={TIPS: "box", ".*": "capsule"}, self_collisions=False, keep=TIPS, visual=False)
    arena = mja.TableArena(objects=[mja.Object("cube", pos=(0.3, 0.3))])
    arena.attach(spec, "r_", pos=(-0.2, 0, 0.02), on=0)
    arena.vary(mass=mja.dr.Term("body.mass", "r_.*"))
    assert arena.mj_model.body("r_hand").mass == pytest.approx(0.3)
    assert mja.robots.steps_per_second(spec, seconds=0.01) > 0
    for wrong in (-1, 0, float("nan"), None, True):
        with pytest.raises(ValueError, match=r"^`seconds` must be a number > 0 \[s\], got "):
            mja.robots.steps_per_second(spec, seconds=wrong)
    says = (
        "`robot` must be one mujoco.MjSpec, got a tuple that begins with one: `simplify` gives a spec and a report, as in "
        "`spec, report = simplify(...)`."
    )
    with pytest.raises(TypeError, match=f"^{re.escape(says)}$"):
        mja.TableArena().attach(arm(visual=False))


def test_packages():
    """What is known says what it is; what is not there says what to install, and what is unknown what is known."""
    assert all(robot.install.startswith("pip install") and robot.licence for robot in mja.robots.known().values())
    with pytest.raises(ValueError, match=r"^`name`: no known robot is called 'pand': did you mean `panda`\?$"):
        mja.robots.load("pand")


def test_packages_are_documented():
    """With their licences and versions, those that the tests install."""
    text, versions = (
        (pathlib.Path(__file__).parents[1] / "docs" / "robots.md").read_text(),
        (pathlib.Path(__file__).parent / "robots.txt"),
    )
    for name, robot in mja.robots.known().items():
        assert f"| `{name}` |" in text
        assert f"| {robot.licence} |" in text
        assert f"`{robot.install}`" in text
        assert robot.install.split()[-1] in versions.read_text().split()


def test_package_that_is_missing(monkeypatch, tmp_path):
    """One sentence, with the command; a version without the file is told apart."""
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    with pytest.raises(ModuleNotFoundError) as error:
        mja.robots.load("panda")
    said = "The robot 'panda' comes with the package gym_hil, which is not installed: pip install --no-deps gym-hil==0.1.14."
    assert str(error.value) == said
    (tmp_path / "gym_hil").mkdir()
    (tmp_path / "gym_hil" / "__init__.py").write_text("raise RuntimeError")  # it is not imported
    with pytest.raises(
        FileNotFoundError,
        match=r"^`name`: 'panda' needs assets/panda.xml of the package gym_hil, but the installed version lacks it",
    ):
        mja.robots.load("panda")
    (tmp_path / "gym_hil" / "assets").mkdir()
    (tmp_path / "gym_hil" / "assets" / "panda.xml").write_text(ARM.format(compiler=""))
    assert mja.robots.load("panda").compile().nu == 3


def test_measured(monkeypatch):
    """Speeds before and after, if asked for: here a step takes 2 ms of a clock with meshes and 1 ms without, at best."""
    clock, calls = [0.0], []

    def step(model, data, n):
        calls.append(n)
        clock[0] += n * (0.002 if model.nmesh else 0.001) * (1.0 if len(calls) > 4 else 3.0)

    monkeypatch.setattr(mujoco, "mj_step", step)
    monkeypatch.setattr(time, "perf_counter", lambda: clock[0])
    _, report = arm(collision="primitive", visual=False, measure=True)
    assert report.speeds == pytest.approx((500, 1000))
    assert "steps per second in C MuJoCo: 500 -> 1,000, 2.00 times as many" in str(report).splitlines()
    assert arm(collision="primitive")[1].speeds is None
