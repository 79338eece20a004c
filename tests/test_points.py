"""Bodies that only slide, which MuJoCo takes for points where their centres of mass are their origins."""

import warnings

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr

MJCF = """
<mujoco>
  <worldbody>
    <body name="press" pos="0 0 1">
      <joint name="slide" type="slide" axis="0 0 1" armature="0.1"/>
      <geom name="plate" type="box" size="0.1 0.2 0.3" {weight}/>
      {more}
    </body>
  </worldbody>
</mujoco>"""
LIGHT = '<geom name="knob" size="0.05" {weight}/>'


def edited(text, attribute, value):
    """The model that MuJoCo compiles of the same MJCF with another number, which nothing of the library has touched."""
    spec = mujoco.MjSpec.from_string(text)
    kind, _, name = attribute.partition(".")
    element = spec.body("press") if kind == "body" else spec.geom("plate")
    if attribute == "body.mass":
        model = spec.copy().compile()
        body = model.body("press")
        element.explicitinertial, element.ipos, element.iquat = True, body.ipos, body.iquat
        element.mass, element.inertia = value, body.inertia * (value / body.mass[0])
    else:
        setattr(element, name, value)
    return spec.compile()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("attribute", "value", "weight", "more"),
    [
        ("body.mass", 2.0, 'mass="1"', LIGHT),
        ("geom.size", (0.4, 0.1, 0.2), 'density="50"', ""),
        ("geom.size", (0.4, 0.1, 0.2), 'mass="1"', LIGHT.format(weight='mass="0"')),
        ("geom.mass", 2.0, 'mass="1"', ""),
        ("geom.density", 300.0, 'density="50"', ""),
    ],
    ids=["mass", "size", "size_beside_nothing", "geom_mass", "density"],
)
def test_stay_points(attribute, value, weight, more):
    """Nominally and in each world their weights are those of the MJCF with these numbers."""
    text = MJCF.format(weight=weight, more=more.format(weight='mass="0.1"'))
    arena = mja.Arena.from_xml(text)
    arena.vary(one=dr.Term(attribute, "press" if attribute.startswith("body") else "plate"))
    plain, nominal = mujoco.MjModel.from_xml_string(text), arena.nominal_params()
    assert plain.body("press").simple == 2
    assert plain.body("press").invweight0 != pytest.approx(1 / (3 * (plain.body("press").mass[0] + 0.1)), rel=0.1)
    number = jnp.reshape(jnp.asarray(value, float), nominal.terms["one"].shape)
    varied = nominal._replace(terms={"one": number})
    for params, want in ((nominal, plain), (varied, edited(text, attribute, value))):
        got = jax.jit(arena.apply)(arena.put_model("jax"), params)
        for field in ("body_invweight0", "dof_invweight0", "body_mass", "body_inertia"):
            np.testing.assert_allclose(getattr(arena.compile(params), field), getattr(want, field), rtol=1e-6)
            np.testing.assert_allclose(getattr(got, field), getattr(want, field), rtol=1e-6)
    weighs = weight.startswith("density") or attribute != "geom.size"
    assert (edited(text, attribute, value).body_invweight0 != plain.body_invweight0).any() == weighs


@pytest.mark.parametrize(
    ("attribute", "element"),
    [("geom.pos", "plate"), ("geom.size", "plate"), ("body.ipos", "press"), ("joint.pos", "slide")],
)
def test_are_points_no_more(attribute, element):
    """Where the centre of mass or the axes can move, MuJoCo has other weights; a warning gives both."""
    arena = mja.Arena.from_xml(MJCF.format(weight='mass="1"', more=LIGHT.format(weight='mass="0.1"')))
    message = r"^Body `press` only slides\. .* whose `body_invweight0` is 0\.909, .* nominally 0\.278\.$"
    with pytest.warns(UserWarning, match=message):
        arena.vary(one=dr.Term(attribute, element))
    arena.vary(other=dr.Term("joint.damping", "slide"))  # of which nothing more is said
    assert arena.mj_model.body("press").invweight0[0] == pytest.approx(1 / 3.6)


def test_of_all_alike():
    """Slides along three axes without armature weigh the same either way: nothing is said."""
    text = MJCF.format(weight='mass="1"', more='<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>')
    arena = mja.Arena.from_xml(text.replace('armature="0.1"', ""))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arena.vary(one=dr.Term("body.ipos", "press"))
    assert arena.mj_model.body("press").simple == 0


@pytest.mark.parametrize("order", [("place", "mass"), ("mass", "place")])
@pytest.mark.parametrize("calls", [1, 2])
def test_whatever_the_order(order, calls):
    """A mass of its own makes a body independent of where its geoms are, whichever term comes first."""
    terms = {"place": dr.Term("geom.pos", "plate"), "mass": dr.Term("body.mass", "press")}
    arena = mja.Arena.from_xml(MJCF.format(weight='mass="1"', more=""))
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Body `press` only slides" if calls == 2 else "`place` varies the place")
        warnings.filterwarnings("ignore", "`place` varies the place")
        for names in [order] if calls == 1 else [order[:1], order[1:]]:
            arena.vary(**{name: terms[name] for name in names})
    assert arena.mj_model.body("press").simple == 2
    assert arena.mj_model.body("press").invweight0[0] == pytest.approx(1.0)


def test_a_geom_that_weighs_later():
    """What is edited after `vary` counts: worlds are those that MuJoCo compiles, on a body that is a point no more."""
    arena = mja.Arena.from_xml(MJCF.format(weight='mass="1"', more=LIGHT.format(weight='mass="0"')))
    arena.vary(size=dr.Term("geom.size", "plate"))
    arena.spec.geom("knob").mass = 0.2
    params = arena.nominal_params()._replace(terms={"size": jnp.array([[0.3, 0.1, 0.2]])})
    got, want = jax.jit(arena.apply)(arena.put_model("jax"), params), arena.compile(params)
    assert want.body("press").simple == arena.mj_model.body("press").simple == 0
    for field in ("body_invweight0", "dof_invweight0", "body_inertia"):
        np.testing.assert_allclose(getattr(got, field), getattr(want, field), rtol=1e-6)
