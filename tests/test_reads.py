"""Rules of what follows: they declare all that they read, and leave out no field that changes."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.interpreters import partial_eval
from test_coming_and_going import BODIES, SCENE
from test_setconst import ACTUATORS, ARM, FAST_COMPILE, FREE, TENDONS

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.named import field as field_of
from mjx_arenas.write import follows
from mjx_arenas.write.replace import replace
from mjx_arenas.write.touched import Touched

TIED = SCENE.replace(
    "</mujoco>",
    '<equality><weld body1="door" body2="link"/><connect body1="ball" anchor="0 0 .1"/></equality></mujoco>',
)
SCENES = {"arm": ARM, "free": FREE, "tendons": TENDONS, "actuators": ACTUATORS, "tied": TIED}
RULES = {rule.field: rule for rule in follows.RULES}
READ = sorted({name for rule in follows.RULES for name in rule.reads} - {follows.PRESENCE})
"""All that any rule reads."""
NEAR = {"body_mass", "body_ipos"}
"""Lengths of tendons do not depend on them: trees are put near the origin, for the sake of rounding, by their centres of mass."""


@functools.cache
def arena_of(name):
    return mja.Arena.from_xml(SCENES[name])


def touch(model, masks, comes_and_goes=False):
    """Masks (N, ...) by field; bounds follow from sizes."""
    if "geom_size" in masks:
        masks = masks | {"geom_rbound": masks["geom_size"].any(-1)}
    return Touched(model, masks, comes_and_goes)


def following(scene, model, there):
    """All fields that follow, as a function of the model alone."""
    masks = {name: np.ones(field_of(scene.model, name).shape, bool) for name in READ}
    world = follows.World(scene, model, model, there, None, touch(scene.model, masks, True))
    found = {}
    for rule in follows.RULES:  # as `complete` does
        found[rule.field] = rule.value(world)
        world.model = replace(world.model, {rule.field: found[rule.field]})
    return found


def floats(model):
    """The names of all fields of numbers, and the numbers."""
    return {name: x for name, x in vars(model).items() if isinstance(x, jax.Array) and x.dtype.kind == "f"}


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_all_that_is_read_is_declared(name):
    """By the operations of the traced program: a rule that reads a field without saying so would not be computed where that varies."""
    arena = arena_of(name)
    scene, model = arena.record.scene, arena.put_model("warp")
    fields = floats(model)

    def run(numbers, there):
        return following(scene, replace(model, dict(zip(fields, numbers, strict=True))), there)

    there = jnp.ones(len(scene.groups.roots) + 1, bool)
    traced, out = jax.make_jaxpr(run, return_shape=True)(list(fields.values()), there)
    for i, field in enumerate(out):
        wanted = [k == i for k in range(len(out))]
        needed = partial_eval.dce_jaxpr(traced.jaxpr, wanted)[1]
        read = {one for one, used in zip([*fields, follows.PRESENCE], needed, strict=True) if used}
        declared = {field} | RULES[field].reads | (NEAR if field == "tendon_length0" else set())
        assert read - RULES.keys() <= declared, field  # what a tree does not change in is read from the field itself


@pytest.fixture(scope="module", params=SCENES)
def known(request):
    """A scene, its numbers, and all fields that follow from them."""
    arena = arena_of(request.param)
    scene, model = arena.record.scene, arena.put_model("warp")
    there = jnp.ones(len(scene.groups.roots) + 1, bool)

    def run(numbers, there):
        return following(scene, replace(model, numbers), there)

    return scene, jax.jit(run, compiler_options=FAST_COMPILE), {n: np.asarray(getattr(model, n)) for n in READ}, there


def changed(before, after):
    """Names of the fields of which a number is another one, by more than rounding."""
    found = set()
    for name, value in before.items():
        size = np.maximum(np.abs(np.asarray(value)), 1e-3 * np.abs(value).max(initial=1e-6))
        if (np.abs(np.asarray(after[name]) - value) > 1e-3 * size).any():
            found.add(name)
    return found


@pytest.mark.slow
def test_what_changes_is_computed(known):
    """One row of one field at a time takes other numbers: each field that changes with them is one that can differ, by its rule."""
    scene, run, numbers, there = known
    before, rng, reached = run(numbers, there), np.random.default_rng(0), set()
    for field, nominal in numbers.items():
        first = field.startswith("body_")  # the world
        for row in range(first, len(nominal)) if field != "geom_rbound" else ():
            if field == "tendon_armature" and not nominal[row]:  # which cannot vary
                continue
            other = nominal.copy()
            other[row] = 1.3 * nominal[row] + rng.uniform(0.1, 0.3, nominal[row].shape)
            if field.endswith(("quat", "axis", "light_dir")):
                other[row] /= np.linalg.norm(other[row])
            mask = np.zeros(nominal.shape, bool)
            mask[row] = True
            given = numbers | {field: other}
            if field == "geom_size":
                given["geom_rbound"] = np.where(mask.any(-1), 1.5, 1) * numbers["geom_rbound"]
            touched = touch(scene.model, {field: mask})
            found = changed(before, run(given, there)) - {field}
            left = [name for name in found if not RULES[name].differs(scene, touched)]
            assert not left, (field, row)
            reached |= found
    some = {"body_subtreemass", "stat.center", "stat.extent", "stat.meansize", "stat.meanmass"}
    assert some <= reached
    assert reached > {"dof_M0", "dof_invweight0", "body_invweight0", "stat.meaninertia"} or not scene.model.nv


@pytest.mark.slow
def test_what_comes_and_goes_is_computed():
    """Of bodies that are not there, all that changes: no field beside differs."""
    arena = mja.Arena.from_xml(SCENE)
    arena.vary(there=dr.Term("body.active", list(BODIES)))
    scene, model = arena.record.scene, arena.put_model("warp")
    run = jax.jit(lambda there: following(scene, model, there), compiler_options=FAST_COMPILE)
    there = np.ones(len(scene.groups.roots) + 1, bool)
    before, touched = run(there), touch(scene.model, {}, True)
    found = set()
    for i in range(len(there) - 1):
        found |= changed(before, run(np.arange(len(there)) != i))
    assert found == {name for name in RULES if RULES[name].differs(scene, touched)}
