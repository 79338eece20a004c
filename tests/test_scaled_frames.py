"""Frames that scale what is in them: refused where numbers of the compiled model would be written into the spec; all else works."""

import re

import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.build import mjcf

pytestmark = pytest.mark.skipif(
    not hasattr(mujoco.MjSpec().worldbody.add_frame(), "scale"), reason="frames scale since MuJoCo 3.16"
)
SCENE = """<mujoco><asset><mesh name="m" vertex="0 0 0 .02 0 0 0 .03 0 0 0 .015"/></asset><worldbody>
<body name="desk" pos="0 0 .4"><geom name="top" type="box" size=".3 .2 .02"/></body>
<body name="plain" pos="2 0 1"><joint name="plain"/><geom name="plain" size=".1"/></body>
<body name="pot" pos="0 0 .5"><freejoint/><geom name="pot" type="box" size=".03 .03 .08"/></body>
<frame pos="0 1 0"><frame {}><body name="mug" pos="0 0 .24"><joint name="mug"/><geom name="mug" size=".02"/>
  <site name="mug" size=".01"/><body name="lid"><geom name="cup" type="box" size=".03 .03 .03"/></body></body>
  <body name="bench" pos="2 2 .2"><geom name="seat" type="box" size=".2 .2 .02"/></body>
  <body name="cube" pos="1 1 .5"><freejoint/><geom size=".03"/></body>
  <body name="rock" pos="1 2 .5"><freejoint/><geom name="rock" type="mesh" mesh="m"/></body></frame></frame>
</worldbody>
<tendon><fixed name="plain"><joint joint="plain" coef="1"/></fixed><fixed name="mug"><joint joint="mug" coef="1"/></fixed></tendon>
<actuator><motor name="plain" joint="plain"/><motor name="mug" joint="mug"/><position name="pull" tendon="mug" kp="3" dampratio="1"/>
  <position name="hold" joint="plain" kp="3" dampratio="1"/></actuator></mujoco>"""
SCALES = ('scale="2"', 'massscale="3"')
REFUSED = {
    "a table": (lambda xml: mja.Arena.from_xml(xml, tables=["bench"]), "geom 'seat'"),
    "an object": (lambda xml: mja.Arena.from_xml(xml, tables=["desk"], objects=["cube"]), "body 'cube'"),
    "a mesh": (mja.simplify, "geom 'rock'"),
}


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("what", REFUSED)
def test_refused(scale, what):
    call, named = REFUSED[what]
    with pytest.raises(ValueError, match=f"{named} is in a <frame> with a `scale` or `massscale`, so its numbers"):
        call(SCENE.format(scale))


@pytest.mark.parametrize("scale", SCALES)
def test_object_of_a_file(scale, tmp_path):
    path = tmp_path / "mug.xml"
    body = '<body name="mug"><geom size=".03"/></body>'
    path.write_text(f"<mujoco><worldbody><frame {scale}>{body}</frame></worldbody></mujoco>")
    with pytest.raises(ValueError, match=r"Object 'mug': `file`: body 'mug' is in a <frame> with a `scale`"):
        mja.TableArena(objects=[mja.Object("mug", "mjcf", file=path)])


@pytest.mark.parametrize("scale", SCALES)
def test_terms(scale):
    arena = mja.Arena.from_xml(SCENE.format(scale))
    inside, refers = ("it is in", "it refers to what is in")
    refused = {
        "geom.friction": ("cup", inside),
        "body.pos": ("lid", inside),
        "joint.damping": ("mug", inside),
        "body.rpy": ("mug", inside),
        "tendon.stiffness": ("mug", refers),
        "actuator.gear": ("mug", refers),
        "actuator.kp": ("pull", refers),
    }
    for attribute, (name, why) in refused.items():
        what = f"'{attribute}' of {attribute.partition('.')[0]} '{name}' cannot vary, as {why} a <frame> with a `scale`"
        with pytest.raises(ValueError, match=what):
            arena.vary(q=dr.Term(attribute, name))


@pytest.mark.parametrize("scale", SCALES)
def test_the_rest_works(scale):
    """A table, an object and terms of what is in no such frame; a term of all leaves the others out. They stay as MuJoCo scales them."""
    xml = SCENE.format(scale)
    for tendon in re.findall(r"<fixed name=.mug.*?</fixed>|<position name=.pull.*?/>", xml):
        xml = xml.replace(tendon, "")  # MuJoCo writes no width of fixed tendons
    arena = mja.Arena.from_xml(xml, tables=["desk"], objects=["pot"])
    arena.vary(
        friction=dr.Term("geom.friction"),
        mass=dr.Term("body.mass", "plain"),
        gravity=dr.Term("option.gravity"),
        gear=dr.Term("actuator.gear"),
        kp=dr.Term("actuator.kp", "hold"),
    )
    params = arena.nominal_params()
    params = params._replace(terms=params.terms | {"mass": params.terms["mass"] * 2})
    model, plain = arena.compile(params), mujoco.MjModel.from_xml_string(xml)
    assert model.body("plain").mass == pytest.approx(2 * plain.body("plain").mass)
    for name in ("mug", "lid", "cube", "rock"):
        assert model.body(name).mass == plain.body(name).mass
        np.testing.assert_array_equal(model.body(name).pos, plain.body(name).pos)
    np.testing.assert_array_equal(model.geom("cup").size, plain.geom("cup").size)
    np.testing.assert_array_equal(model.actuator_gainprm, plain.actuator_gainprm)
    again = mujoco.MjModel.from_xml_string(arena.to_xml(params))
    assert mjcf.lost(model, again) == []
    spec, _ = mja.simplify(xml.replace('name="rock" type="mesh" mesh="m"', 'name="rock" size=".02"'))
    assert spec.compile().body("mug").mass == plain.body("mug").mass
