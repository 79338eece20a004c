"""Frames that scale what is in them: refused wherever numbers of the compiled model would be written into the spec."""

import mujoco
import pytest

import mjx_arenas as mja
from mjx_arenas import dr

pytestmark = pytest.mark.skipif(
    not hasattr(mujoco.MjSpec().worldbody.add_frame(), "scale"), reason="frames scale since MuJoCo 3.16"
)
SCENE = """<mujoco><worldbody>
<body name="desk" pos="0 0 .4"><geom name="top" type="box" size=".3 .2 .02"/></body>
<body name="plain" pos="2 0 1"><joint name="plain"/><geom name="plain" size=".1"/></body>
<frame pos="0 1 0"><frame {}><body name="mug" pos="0 0 .24"><joint name="mug"/><geom size=".02"/>
  <body name="lid"><geom name="cup" type="box" size=".03 .03 .03"/></body></body></frame></frame>
</worldbody>
<actuator><motor name="plain" joint="plain"/></actuator></mujoco>"""
SCALES = ('scale="2"', 'massscale="3"')


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    "call",
    [
        lambda xml: mja.Arena.from_xml(xml, tables=["desk"]),
        lambda xml: mja.Arena.from_xml(xml, objects=["mug"]),
        mja.simplify,
    ],
)
def test_refused(scale, call):
    with pytest.raises(ValueError, match=r"body 'mug' is in a <frame> with a `scale` or `massscale`, so its numbers"):
        call(SCENE.format(scale))


@pytest.mark.parametrize("scale", SCALES)
def test_object_of_a_file(scale, tmp_path):
    path = tmp_path / "mug.xml"
    path.write_text(
        f'<mujoco><worldbody><frame {scale}><body name="mug"><geom size=".03"/></body></frame></worldbody></mujoco>'
    )
    with pytest.raises(ValueError, match=r"Object 'mug': `file`: body 'mug' is in a <frame> with a `scale`"):
        mja.TableArena(objects=[mja.Object("mug", "mjcf", file=path)])


@pytest.mark.parametrize("scale", SCALES)
def test_terms(scale):
    arena = mja.Arena.from_xml(SCENE.format(scale))
    inside = r"'{}' of {} cannot vary, as it is in a <frame> with a `scale` or `massscale`"
    refused = {"geom.friction": "cup", "body.pos": "lid", "joint.damping": "mug", "body.rpy": "mug"}
    for attribute, name in refused.items():
        with pytest.raises(ValueError, match=inside.format(attribute, f"{attribute.partition('.')[0]} '{name}'")):
            arena.vary(q=dr.Term(attribute, name))
    with pytest.raises(ValueError, match=r"actuator 'plain' cannot vary, as a <frame> .* may scale it, too"):
        arena.vary(q=dr.Term("actuator.gear", "plain"))


@pytest.mark.parametrize("scale", SCALES)
def test_the_rest_varies(scale):
    """What is in no such frame; a term of all leaves the others out, and they stay as MuJoCo scales them."""
    xml = SCENE.format(scale)
    arena = mja.Arena.from_xml(xml)
    arena.vary(friction=dr.Term("geom.friction"), mass=dr.Term("body.mass", "plain"), gravity=dr.Term("option.gravity"))
    params = arena.nominal_params()
    assert params.terms["friction"].shape == (2, 3)
    params = params._replace(terms=params.terms | {"mass": params.terms["mass"] * 2})
    model, plain = arena.compile(params), mujoco.MjModel.from_xml_string(xml)
    assert model.body("plain").mass == pytest.approx(2 * plain.body("plain").mass)
    for name in ("mug", "lid"):
        assert model.body(name).mass == plain.body(name).mass
        assert (model.body(name).pos == plain.body(name).pos).all()
    assert (model.geom("cup").size == plain.geom("cup").size).all()
