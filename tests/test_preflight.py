"""`check_randomization`: what is wrong with a randomizer, by field; and nothing is, with those of this library."""

import inspect
import pathlib
import re

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas.preflight import rules as preflight_checks

pytestmark = pytest.mark.slow_on("warp")

N = 4
# A table that moves, a box and a ball on it, an arm that hangs over it, and a wheel.
SCENE = """
<mujoco>
  <option timestep="0.004"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="table" pos="0 0 .4"><geom name="slab" type="box" size=".4 .4 .02" friction=".5"/></body>
    <body name="box" pos="0 0 .5"><freejoint/><geom name="box" type="box" size=".03 .04 .05" friction=".6"/></body>
    <body name="ball" pos=".2 0 .5"><freejoint/><geom name="ball" size=".03" friction=".7" priority="1"/></body>
    <body name="arm" pos="0 1 1"><joint name="arm" axis="0 1 0"/>
      <geom name="link" type="capsule" pos=".15 0 0" euler="0 90 0" size=".02 .15"/><site name="elbow"/>
      <body name="hand" pos=".3 0 0"><joint name="hand" axis="0 1 0"/>
        <geom name="hand" type="cylinder" size=".02 .04"/><geom name="tip" type="ellipsoid" size=".01 .02 .03" pos=".05 0 0"/>
      </body>
    </body>
    <body name="wheel" pos="0 -1 1"><joint name="wheel"/><geom name="wheel" type="sphere" size=".05" mass="1"/></body>
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def mj_model():
    return mujoco.MjModel.from_xml_string(SCENE)


@pytest.fixture(scope="module", params=["jax", "warp"])
def model(request, mj_model):
    mj_model = mj_model if request.param == "warp" else collidable_in_jax(mj_model)
    return mjx.put_model(mj_model, impl=request.param)


def collidable_in_jax(mj_model):
    """Without the pairs that it has no function for."""
    spec = mujoco.MjSpec.from_string(SCENE)
    for name in ("hand", "tip"):
        spec.geom(name).contype = spec.geom(name).conaffinity = 0
    return spec.compile()


def batched(model, **values):
    """A randomizer's output: `values` (W, ...) or functions of a field, of N worlds; names with dots as `opt__gravity`."""
    values = {name.replace("__", "."): value for name, value in values.items()}
    for name, value in values.items():
        if callable(value):
            old = model
            for part in name.split("."):
                old = getattr(old, part)
            values[name] = jnp.stack([value(old, i) for i in range(N)])
    in_axes = jax.tree.map(lambda _: None, model).tree_replace(dict.fromkeys(values, 0))
    return model.tree_replace(values), in_axes


def worlds_keys():
    return jax.random.split(jax.random.key(1), N)


def check(model, **values):
    return mja.check_randomization(model, *batched(model, **values))


def table_up(pos, i):
    return pos.at[1, 2].add(0.1 * i)


def heavier(mass, i):
    return mass * (1 + i)


def test_right_randomizer(model):
    """What is right is said to be, with what varies and how far."""
    report = check(model, body_pos=table_up, geom_friction=lambda f, i: f + 0.1 * i)
    assert report.ok
    assert report.n_worlds == N
    assert set(report.varies) == {"body_pos", "geom_friction"}
    found = report.varies["body_pos"]
    assert found[:3] == ((model.nbody, 3), 1, "'table'[2]")
    np.testing.assert_allclose((found.low, found.high), (0.4, 0.7), rtol=1e-6)
    assert re.search(r"^body_pos +\(7, 3\) +1 +'table'\[2\] +0\.4 +0\.7$", str(report), flags=re.MULTILINE)
    assert str(report).startswith("4 worlds, no problems\n")
    with pytest.raises(AttributeError):
        report.n_worlds = 3


@pytest.mark.slow
def test_what_varies_is_of_one_element(model):
    """The bounds are those of the number that varies most, with its name, not of all that vary mixed."""
    report = check(
        model,
        body_mass=lambda mass, i: mass.at[jnp.array([2, 6])].set(jnp.array([0.1 * i, 7 + 0.5 * i])),
        body_pos=lambda pos, i: (
            pos.at[2, 0].add(0.01 * i).at[1, 2].add(-0.1 * i).at[3, 1].add(jnp.nan if i == 0 else 0.0)
        ),
        dof_damping=lambda damping, i: damping.at[12].add(0.2 * i),
        dof_armature=lambda armature, i: armature.at[2].add(0.2 * i),
        qpos0=lambda qpos, i: qpos.at[9].add(0.1 * i),
        jnt_range=lambda limits, i: limits.at[3, 1].add(i),
        geom_aabb=lambda box, i: box.at[(6, 1, 2) if box.ndim == 3 else (6, 5)].add(i),
        opt__gravity=lambda gravity, i: gravity.at[2].add(0.1 * i),
        opt__timestep=lambda step, i: step * (1 + i),
        geom_friction=lambda friction, i: friction,
    )
    got = {name: (v.n_numbers, v.number, round(v.low, 5), round(v.high, 5)) for name, v in report.varies.items()}
    assert got.pop("body_pos")[:2] == (3, "'ball'[1]")  # what is not a number comes first
    assert got == {
        "body_mass": (2, "'wheel'", 7.0, 8.5),
        "dof_damping": (1, "'arm'", 0.0, 0.6),
        "dof_armature": (1, "a joint of 'box' [2]", 0.0, 0.6),
        "qpos0": (1, "a joint of 'ball' [2]", 0.5, 0.8),
        "jnt_range": (1, "'hand'[1]", 0.0, 3.0),
        "geom_aabb": (1, "'tip'[1, 2]" if model.impl.value == "warp" else "'tip'[5]", 0.03, 3.03),
        "opt.gravity": (1, "[2]", -9.81, -9.51),
        "opt.timestep": (1, "", 0.004, 0.016),
        "geom_friction": (0, "'floor'[0]", 1.0, 1.0),
    }


def test_in_axes(model):
    """What `jax.vmap` would answer with an IndexError, or with its own tree's names."""
    model_v, in_axes = batched(model, body_pos=table_up)
    none = jax.tree.map(lambda _: None, model)

    def problems(axes, given=model_v):
        return mja.check_randomization(model, given, axes).problems

    assert problems(none) == ("`body_pos` is batched, but `in_axes` has None for it.",)
    with pytest.raises((IndexError, ValueError)):
        jax.vmap(lambda m: m.body_pos[0], in_axes=(none,), axis_size=N)(model_v)[0].block_until_ready()[0, 0, 0, 0]
    assert problems(in_axes.replace(geom_pos=0)) == ("`geom_pos` is not batched, but `in_axes` has 0 for it.",)
    assert problems(in_axes.replace(body_pos=1)) == (
        "`in_axes` has 1 for `body_pos`: worlds must be the first axis, 0.",
    )
    leaves = len(jax.tree.leaves(model))
    assert problems(0) == (
        f"`in_axes` is 0 for all, but {leaves - 1} fields are not batched, such as `opt.tolerance`.",
    )
    everything = jax.tree.map(lambda x: np.stack([x] * N), model).replace(body_pos=model_v.body_pos)
    assert problems(0, everything) == ()
    must = "`in_axes` must be an mjx.Model that is 0 where leaves are batched and None elsewhere"
    how = "such as jax.tree.map(lambda _: None, model).tree_replace({'body_mass': 0})"
    assert problems({"body_pos": 0}) == (f"{must}, {how}, got a dict of 'body_pos'.",)
    assert problems([0]) == (f"{must}, {how}, got an object of type list.",)
    other = none.replace(geom_priority=model.geom_priority + 1)
    assert problems(other) == (f"{must}, with the static fields of `model_v`, but `geom_priority` of it differ.",)
    assert problems(None)[0] == "`body_pos` is batched, but `in_axes` has None for it."


def test_sizes(model):
    """Leaves of other numbers of worlds, and of shapes that are nobody's."""
    model_v, in_axes = batched(model, body_pos=table_up, geom_rgba=lambda c, i: c / (i + 1))
    fewer = model_v.replace(geom_rgba=model_v.geom_rgba[:3], qpos0=jnp.stack([model.qpos0, model.qpos0 * 2]))
    report = mja.check_randomization(model, fewer, in_axes.replace(qpos0=0))
    assert set(report.problems) == {
        "`geom_rgba` is of 3 worlds, but others are of 2.",
        "`body_pos` is of 4 worlds, but others are of 2.",
    } or set(report.problems) == {
        "`geom_rgba` is of 3 worlds, but others are of 4.",
        "`qpos0` is of 2 worlds, but others are of 4.",
    }
    other = model_v.replace(geom_rgba=jnp.zeros((N, model.ngeom, 3)))
    n = model.ngeom
    assert (
        mja.check_randomization(model, other, in_axes).problems[0]
        == f"`geom_rgba` must have shape ({n}, 4), or (W, ...) with that, got (4, {n}, 3)."
    )


@pytest.mark.parametrize("name", ["geom_contype", "site_size", "geom_type"])
def test_static_fields(model, name):
    """Fields that are the same in all worlds, with equal values or, worse, with an axis of worlds."""
    model_v, in_axes = batched(model, body_pos=table_up)
    old = getattr(model, name)
    for new in (np.concatenate([old, old]), jnp.stack([jnp.asarray(old)] * N)):
        problems = mja.check_randomization(model, model_v.replace(**{name: new}), in_axes).problems
        says = (
            "differs from the template's, but is static in MJX: all worlds share it; change the model before put_model."
        )
        assert problems[0] == f"`{name}` {says}"


def test_static_copies(mj_model):
    """A model that was put anew has numpy copies of its own inside `_impl`: that is named, too."""
    model = mjx.put_model(collidable_in_jax(mj_model), impl="jax")
    model_v, in_axes = batched(model, body_pos=table_up)
    other = model_v.replace(_impl=model_v._impl.replace(dof_hasfrictionloss=~model._impl.dof_hasfrictionloss))
    assert "`_impl.dof_hasfrictionloss` differs" in mja.check_randomization(model, other, in_axes).problems[0]


def test_nothing(model):
    """Nothing batched, nothing changed, worlds that are all the same, or some of them."""
    none = jax.tree.map(lambda _: None, model)
    report = mja.check_randomization(model, model, none)
    assert report.problems == ("Nothing is batched: all worlds are the model that was given.",)
    assert (report.n_worlds, report.ok) == (0, False)
    assert check(model, body_pos=lambda pos, i: pos).problems == (
        "Nothing has changed: all 4 worlds are equal to `model`.",
    )
    assert check(model, body_pos=lambda pos, i: pos.at[1].add(1)).problems == ("All 4 worlds are identical.",)
    two = check(model, body_pos=lambda pos, i: pos.at[1].add(i % 2))
    assert two.ok
    assert two.notes[0] == "Of the 4 worlds 2 are distinct."
    assert check(model, site_pos=lambda pos, i: (pos + 1) / (i - 1)).problems == (
        "`site_pos` has numbers that are not finite in world 1.",
    )


def test_bounds(model, mj_model):
    """Of each shape: those that MuJoCo's compiler gives are right, the template's are not."""
    spec = mujoco.MjSpec.from_string(SCENE)
    names = ("slab", "box", "ball", "link", "hand", "tip")
    for name in names:
        geom = spec.geom(name)
        geom.size = np.asarray(geom.size) * (1.5, 1.2, 1.1)
    ids = np.array([mj_model.geom(name).id for name in names])
    big = spec.compile()
    size, rbound, aabb = (getattr(big, name)[ids] for name in ("geom_size", "geom_rbound", "geom_aabb"))
    shape = model.geom_aabb.shape[1:]

    def half_of_them(new):
        return lambda old, i: old.at[ids].set(new) if i % 2 else old

    right = {
        "geom_rbound": half_of_them(rbound),
        "geom_aabb": half_of_them(aabb.reshape(-1, *shape)),
    }
    sizes = {"geom_size": half_of_them(size)}
    assert check(model, **sizes, **right).ok
    said = "does not belong to `geom_size` in 2 of 4 worlds ('slab' in world 1: "
    for stale in ("geom_rbound", "geom_aabb"):
        report = check(model, **sizes, **{name: value for name, value in right.items() if name != stale})
        (sentence,) = report.problems if model.impl.value == "warp" else report.notes[1:]
        assert sentence.startswith(f"`{stale}` {said}")
        effect = (
            "contacts are lost where it is too small."
            if model.impl.value == "warp"
            else "impl='jax' does not read it here."
        )
        assert sentence.endswith(effect)
    for row, name in enumerate(names):  # each of them alone
        wrong = check(
            model, **sizes, **right | {"geom_rbound": half_of_them(np.where(np.arange(6) == row, 0.9, 1) * rbound)}
        )
        assert f"'{name}' in world 1" in str(wrong)
    mismatch = right | {
        "geom_aabb": lambda old, i: old
    }  # `aabb.at[ids, 3:]` of the other implementation writes nothing
    assert "`geom_aabb` does not belong" in str(check(model, **sizes, **mismatch))


def test_bounds_that_jax_reads(mj_model):
    """`max_geom_pairs` makes MJX on JAX read `geom_rbound`, still not `geom_aabb`."""
    spec = mujoco.MjSpec.from_string(
        SCENE.replace("</mujoco>", '<custom><numeric name="max_geom_pairs" data="4"/></custom></mujoco>')
    )
    for name in ("hand", "tip"):
        spec.geom(name).contype = spec.geom(name).conaffinity = 0
    report = check(mjx.put_model(spec.compile(), impl="jax"), geom_size=lambda size, i: size * (1 + i))
    assert [problem.split()[0] for problem in report.problems] == ["`geom_rbound`"]


def test_masses(model):
    """Inverse weights and the masses of subtrees follow masses: with `set_const` they do."""
    stale = check(model, body_mass=heavier, body_inertia=heavier)
    assert [problem.split()[0] for problem in stale.problems] == [
        "`body_subtreemass`",
        "`body_invweight0`",
        "`dof_invweight0`",
    ]
    assert "in 3 of 4 worlds" in stale.problems[1]
    derive = jax.jit(mja.set_const)
    more = [
        model.replace(body_mass=heavier(model.body_mass, i), body_inertia=heavier(model.body_inertia, i))
        for i in (1, 2)
    ]
    all_worlds = [model, model, *map(derive, more)]
    names = ("body_mass", "body_inertia", "body_subtreemass", "body_invweight0", "dof_invweight0")
    right = {name: jnp.stack([getattr(world, name) for world in all_worlds]) for name in names}
    assert check(model, **right).ok
    assert check(model, **right | {"dof_invweight0": lambda old, i: old}).problems == (
        "`dof_invweight0` is the template's in 2 of 4 worlds in which `body_mass` or `body_inertia` is not: contacts and limits "
        "are too soft or too stiff; mjx_arenas.set_const derives it.",
    )


def test_masses_without_weight(model):
    """A wheel that only turns weighs nothing in its inverse weights: its mass may vary alone, and a table's may."""
    for body in ("wheel", "table"):
        index = {"table": 1, "wheel": 6}[body]
        mass = lambda m, i, index=index: m.at[index].add(0.5 * i)  # noqa: E731
        total = lambda m, i, index=index: m.at[jnp.array([0, index])].add(0.5 * i)  # noqa: E731
        report = check(model, body_mass=mass, body_subtreemass=total)
        assert report.ok, report


def test_unread(model):
    """Writes without effect on one implementation, and not on the other."""
    jax_only = {
        "geom_gap": lambda gap, i: gap + 0.1 * i,
        "body_gravcomp": lambda comp, i: comp + 0.1 * i,
        "dof_frictionloss": lambda loss, i: loss + 0.1 * i,
    }
    on_warp = {"opt__impratio": lambda ratio, i: ratio + i}
    both = {"opt__density": lambda density, i: density + i, "opt__wind": lambda wind, i: wind + i}
    for name, value in (jax_only | on_warp | both).items():
        report = check(model, **{name: value})
        silent = name in both or (name in jax_only) == (model.impl.value == "jax")
        assert report.ok != silent, (name, report)
        assert all(problem.startswith(f"`{name.replace('__', '.')}` ") for problem in report.problems)


@pytest.mark.parametrize("model", ["warp"], indirect=True)
def test_unread_is_unread_on_warp(model):
    """The list is what the step does not take."""
    from mujoco.mjx.warp import forward

    taken = inspect.signature(forward._step_shim).parameters
    for name in preflight_checks.UNREAD[model.impl]:
        assert name.replace(".", "__") not in taken
    assert {"geom_gap", "body_gravcomp", "dof_frictionloss", "opt__density"} <= set(taken)


@pytest.mark.parametrize("model", ["jax"], indirect=True)
def test_unread_is_unread_on_jax(model):
    """The list is what MJX's own modules do not name, but for those that make and describe models."""
    source = pathlib.Path(mjx._src.__file__ or mjx.__file__).parent
    source = source if source.name == "_src" else source / "_src"
    code = "".join(
        path.read_text() for path in source.glob("*.py") if not re.search("_test|^io|^types|^test_", path.name)
    )
    assert "geom_margin" in code
    for name in preflight_checks.UNREAD[model.impl]:
        assert not re.search(rf"\b{name}\b", code), name


def test_flags_of_the_template(model):
    """Once the template has some of it, friction loss, gravity compensation and fluid may vary."""
    spec = mujoco.MjSpec.from_string(SCENE)
    for name in ("hand", "tip"):
        spec.geom(name).contype = spec.geom(name).conaffinity = 0
    spec.option.density = 1
    spec.body("box").gravcomp = 0.1
    for joint in spec.joints:
        joint.frictionloss = 0.1
    some = mjx.put_model(spec.compile(), impl=model.impl.value)
    report = check(
        some,
        body_gravcomp=lambda comp, i: comp + 0.1 * i,
        dof_frictionloss=lambda loss, i: loss + 0.1 * i,
        opt__density=lambda density, i: density + i,
    )
    assert report.ok, report


def test_static_geoms(model):
    """On Warp, moving what is fixed to the world has to go with `place_static`; what moves has not."""
    for index, name, noted in (
        (1, "body_pos", True),
        (1, "body_quat", True),
        (4, "body_pos", False),
        (0, "geom_pos", True),
        (1, "geom_pos", True),
        (2, "geom_pos", False),
    ):
        report = check(model, **{name: lambda pose, i, index=index: pose.at[index, 2].add(0.1 * i)})
        assert report.ok
        says = [note for note in report.notes if "place_static" in note]
        assert len(says) == (noted and model.impl.value == "warp"), (index, name)
        assert all(note.startswith(f"`{name}`: geoms move that are fixed to the world") for note in says)
    both = check(model, body_pos=lambda p, i: p + 0.1 * i, body_quat=lambda q, i: jnp.roll(q, i, -1))
    assert model.impl.value == "jax" or both.notes[0].startswith("`body_pos`, `body_quat`: geoms move")


def test_friction_without_effect(model):
    """Friction that is never the larger, or that a priority overrules."""

    def of(geom, low, high):
        return lambda f, i, g=geom: f.at[g, 0].set(low + (high - low) * i / (N - 1))

    slab, ball = 1, 3
    assert not check(model, geom_friction=of(slab, 0.5, 0.8)).notes  # above the box's 0.6 in some worlds
    (note,) = check(model, geom_friction=of(slab, 0.1, 0.55)).notes
    assert note.startswith("`geom_friction` of 'slab' varies without effect: what touches it has a higher priority")
    assert not check(model, geom_friction=of(ball, 0.1, 0.2)).notes  # has the highest priority
    assert not check(model, geom_friction=of(ball, 0.1, 0.2)).problems


def test_bodies_without_their_start(model):
    """`body_pos` and `body_quat` of a body with a free joint do nothing: its start is in `qpos0`, which must move along."""

    def box_up(pos, i):
        return pos.at[2, 2].add(0.1 * i)

    (sentence,) = check(model, body_pos=box_up).problems
    assert sentence == (
        "`body_pos` of 'box' has no effect in 3 of 4 worlds, as bodies with a free joint start where `qpos0` has them, which is "
        "the template's there: write that, too."
    )
    assert check(model, body_pos=box_up, qpos0=lambda qpos, i: qpos.at[2].add(0.1 * i)).ok
    turned = check(model, body_quat=lambda quat, i: quat.at[3].set(jnp.array([0, 0, 1.0, 0]) if i else quat[3]))
    assert [p.split(" in ")[0] for p in turned.problems] == ["`body_quat` of 'ball' has no effect"]
    # In MuJoCo, too, they have none.
    spec = mujoco.MjSpec.from_string(SCENE)
    compiled = spec.compile()
    compiled.body_pos[2, 2] += 0.1
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    assert data.body("box").xpos[2] == 0.5


def test_what_stands_on_what_moves(model):
    """A table that moves alone may leave behind what stands on it: that depends on the environment."""
    note = (
        "What may stand on 'table', which moves, starts where the template has it: `qpos0` has 'box', 'ball' in the same place in "
        "all worlds, unless the environment sets it."
    )
    report = check(model, body_pos=table_up)
    assert report.ok
    assert note in report.notes
    assert note not in check(model, body_pos=table_up, qpos0=lambda qpos, i: qpos.at[2].add(0.1 * i)).notes
    assert note not in check(model, body_pos=lambda pos, i: pos.at[4, 2].add(0.1 * i)).notes  # the arm


def test_negative(model):
    """Numbers that mean nothing below zero."""
    (sentence,) = check(model, geom_friction=lambda f, i: f.at[1, 0].set(0.2 - 0.15 * i)).problems
    assert sentence == "`geom_friction` must be >= 0, got -0.25 in 2 of 4 worlds."
    assert check(model, geom_margin=lambda margin, i: margin - 0.1 * i).ok


def test_one_reason_one_sentence(model):
    """Many fields that are wrong for one reason."""
    some = {"body_pos": table_up, "geom_rgba": lambda c, i: c / (i + 1), "site_pos": lambda p, i: p + i}
    model_v, _ = batched(model, **some)
    none = jax.tree.map(lambda _: None, model)
    names = "`body_pos`, `site_pos`, `geom_rgba`"

    def problems(axes, given=model_v):
        (sentence,) = mja.check_randomization(model, given, axes).problems
        listed, _, rest = sentence.partition(" are ")
        assert sorted(listed.split(", ")) == sorted(names.split(", "))
        return rest

    assert problems(none) == "batched, but `in_axes` has None for them."
    everything = jax.tree.map(lambda x: np.stack([x] * N), model)
    (sentence,) = mja.check_randomization(model, everything.replace(body_pos=model_v.body_pos), none).problems
    assert sentence.endswith(
        f" and {len(jax.tree.leaves(model)) - 4} more are batched, but `in_axes` has None for them."
    )
    (sentence,) = mja.check_randomization(model, model_v, none.tree_replace(dict.fromkeys(some, 1))).problems
    assert re.fullmatch(r"`in_axes` has 1 for `\w+`, `\w+`, `\w+`: worlds must be the first axis, 0\.", sentence)
    zeros = none.tree_replace(dict.fromkeys([*some, "geom_pos", "geom_quat"], 0))
    (sentence,) = mja.check_randomization(model, model_v, zeros).problems
    assert sentence == "`geom_pos`, `geom_quat` are not batched, but `in_axes` has 0 for them."


def test_one_world(model):
    """It is one world, not 1 worlds."""
    model_v, in_axes = batched(model, body_pos=lambda pos, i: pos)
    report = mja.check_randomization(model, model_v.replace(body_pos=model_v.body_pos[:1]), in_axes)
    assert report.problems == ("Nothing has changed: the one world is equal to `model`.",)
    assert str(report).startswith("1 world, 1 problem\n")


def test_bad_arguments(model):
    """Those that are no randomizer's fault."""
    none = jax.tree.map(lambda _: None, model)
    with pytest.raises(TypeError, match=r"^`model_v` must be an mjx\.Model, got tuple\.$"):
        mja.check_randomization(model, (model, none), none)
    with pytest.raises(TypeError, match=r"^`model` must be an mjx\.Model, got MjModel\.$"):
        mja.check_randomization(mujoco.MjModel.from_xml_string("<mujoco/>"), model, none)
    with pytest.raises(
        ValueError,
        match=r"^`model` must be of one world, got `body_pos` of shape \(4, 7, 3\): give the model before it was randomized\.$",
    ):
        mja.check_randomization(batched(model, body_pos=lambda p, i: p)[0], model, none)
    swapped = r"^`model_v` must be the model that the randomizer returned, got the tree of axes: is it swapped with `in_axes`\?$"
    with pytest.raises(TypeError, match=swapped):
        mja.check_randomization(model, *reversed(batched(model, body_pos=table_up)))
