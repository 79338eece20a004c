"""Ground that is a height field, one for all worlds: what rolls there rolls as in the compiled world; what MJX gets wrong is refused."""

import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values
from mjx_arenas.preflight.report import check_randomization

X, Y = np.meshgrid(np.linspace(-2, 2, 17), np.linspace(-1, 1, 11))
BUMPS = " ".join(f"{z:.4f}" for z in ((np.sin(3 * X) * np.cos(4 * Y) + 1) / 2).ravel())
HILLS = f"""<mujoco><asset><hfield name="h" nrow="11" ncol="17" size="2 1 .2 .1" elevation="{BUMPS}"/></asset><worldbody>
<body name="land"><geom name="hills" type="hfield" hfield="h" pos="0 0 .05"/></body>
<body name="ball" pos=".1 .2 .42"><freejoint/><geom name="ball" size=".12" mass="1"/></body>
<body name="pole" pos="-.6 -.3 .5" euler="20 70 0"><freejoint/><geom name="pole" type="capsule" size=".06 .15" mass="1"/></body>
</worldbody></mujoco>"""
TERMS = {
    "grip": dr.Term("geom.friction", "hills", "sliding"),
    "mass": dr.Term("geom.mass", "ball"),
    "place": dr.Term("geom.pos", "hills"),
    "turn": dr.Term("body.rpy", "land", "yaw"),
}
SIZE = {"size": dr.Term("geom.size", ["ball", "pole"])}  # of what rolls, which MJX on JAX cannot vary
WORLDS = (
    {
        "grip": [[0.2, 0, 0]],
        "mass": [0.3],
        "place": [[0.3, -0.1, 0.08]],
        "turn": [[0, 0, 0.5]],
        "size": [[0.1] * 3, [0.05, 0.2, 0]],
    },
    {
        "grip": [[1.2, 0, 0]],
        "mass": [2.0],
        "place": [[-0.2, 0.15, -0.04]],
        "turn": [[0, 0, -0.8]],
        "size": [[0.2] * 3, [0.09, 0.12, 0]],
    },
)
STEPS = 150
AS_C = {
    "warp": 2e-4,
    "jax": 2e-3,
}  # [m] of a ball: MJX keeps four contacts of it, on JAX of those within 1 mm of the deepest; C all


def varied(terms):
    arena = mja.Arena.from_xml(HILLS)
    arena.vary(**terms)
    return arena


def alone(model, impl):
    """(nq,) where a compiled world is after some steps by MuJoCo's own MJX."""
    room = {} if impl == "jax" else {"naconmax": 40, "njmax": 160}
    data, put = mjx.make_data(model, impl=impl, **room), mjx.put_model(model, impl=impl)
    return jax.jit(lambda put, data: jax.lax.fori_loop(0, STEPS, lambda _, data: mjx.step(put, data), data))(
        put, data
    ).qpos


@pytest.mark.xslow_on("jax")
@pytest.mark.slow
def test_rolls_as_in_c(impl):
    """On hills that stand elsewhere, turned, and of other friction, what rolls is where MJX has it in the compiled world, and C."""
    terms = TERMS if impl == "jax" else TERMS | SIZE
    arena = varied(terms)
    nominal = jax.tree.map(np.asarray, arena.nominal_params())
    each = [with_values(nominal, {name: np.array(world[name], float) for name in terms}) for world in WORLDS]
    batch = arena.batch(arena.put_model(impl), jax.tree.map(lambda *x: jnp.asarray(np.stack(x)), *each))
    got = np.asarray(mja.rollout(batch, mja.make_data(batch), STEPS).qpos)
    at = np.r_[0:3, 7:10]
    for w in range(2):
        model, c = arena.c_world(batch.world(w))
        np.testing.assert_allclose(got[w, at], np.asarray(alone(model, impl))[at], atol=1e-4)
        mujoco.mj_step(model, c, STEPS)
        assert c.ncon > 1
        np.testing.assert_allclose(got[w, :3], c.qpos[:3], atol=AS_C[impl])
    assert np.abs(got[0] - got[1])[at].max() > 10 * AS_C[impl]


REFUSED = {
    "size": (
        {"size": dr.Term("geom.size", "ball")},
        "impl='jax' of MJX cannot vary the size of geom 'ball' (`size`), as it tests height field 'hills' only as far as the size in the "
        "MJCF reaches: use impl='warp'.",
    ),
    "margin of the field": (
        {"margin": dr.Term("geom.margin", "hills")},
        "impl='jax' of MJX cannot vary 'geom.margin' of geom 'hills', as MJX has no margins of contacts with height fields: "
        "use impl='warp'.",
    ),
    "margin of a ball": (
        {"margin": dr.Term("geom.margin", "ball")},
        "impl='jax' of MJX cannot vary 'geom.margin' of geom 'ball', as MJX has no margins of contacts with height fields: "
        "use impl='warp'.",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_on_jax(case):
    """Also as a `randomization_fn`, whose template is an environment's own."""
    terms, sentence = REFUSED[case]
    arena, name = varied(terms), next(iter(terms))
    randomize = arena.randomization_fn(mja.ArenaRanges(terms={name: mja.Uniform(0.2, 0.4)}))
    template = mjx.put_model(arena.mj_model, impl="jax")
    for call in (lambda: arena.put_model("jax"), lambda: randomize(template, mja.world_keys(0, range(2)))):
        with pytest.raises(ValueError, match=f"^{re.escape(sentence)}$"):
            call()


def test_heights_are_stretched():
    """Half the relief compiles to the same heights: lower ones need another size, which MJX shares."""
    with pytest.raises(
        ValueError, match=r"'hfield\.data' cannot vary, as the compiler stretches heights to the size of their field"
    ):
        varied({"heights": dr.Term("hfield.data")})
    model, spec = mujoco.MjModel.from_xml_string(HILLS), mujoco.MjSpec.from_string(HILLS)
    spec.hfields[0].userdata = [0.1 + 0.5 * float(z) for z in model.hfield_data]
    np.testing.assert_allclose(spec.compile().hfield_data, model.hfield_data, atol=1e-6)
    assert isinstance(mjx.put_model(model, impl="jax").hfield_size, np.ndarray)


def test_other_ground_is_refused(impl):
    """The size of a height field is no quantity; sizes that a randomizer of somebody else writes are a problem where contacts get lost."""
    with pytest.raises(
        ValueError,
        match=r"'geom\.size' of geom 'hills' cannot vary, as it is a hfield, whose size MJX shares between worlds",
    ):
        varied({"size": dr.Term("geom.size", "hills")})
    model = varied({}).put_model(impl)

    def told(**fields):
        axes = jax.tree.map(lambda _: None, model).tree_replace(dict.fromkeys(fields, 0))
        report = check_randomization(model, model.tree_replace({n: jnp.stack([*x]) for n, x in fields.items()}), axes)
        return [problem for problem in report.problems if "height field" in problem or "hfield" in problem]

    larger = told(geom_size=(model.geom_size, model.geom_size.at[1, 0].set(0.3)))
    smaller = told(geom_size=(model.geom_size, model.geom_size.at[1, 0].set(0.1)))
    ground = told(hfield_data=(model.hfield_data, 0.5 * model.hfield_data))
    assert smaller == []
    if impl == "warp":
        what = "`hfield_data` has no effect on impl='warp' but that of world 0, whose ground all worlds have: give it to the template."
        assert (larger, ground) == ([], [what])
    else:
        what = "`geom_size` of 'ball' is larger than the template's in world 1, by which impl='jax' tests height fields: contacts are "
        assert (larger, ground) == ([what + "lost; use impl='warp', or the largest template."], [])
