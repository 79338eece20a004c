"""Many worlds of which none is valid: what is said, and when the flags are looked at."""

import functools
import re
import warnings

import jax
import numpy as np
import pytest
from jax.sharding import AxisType, NamedSharding
from jax.sharding import PartitionSpec as P

import mjx_arenas as mja
from mjx_arenas import dr, furniture
from mjx_arenas.rules import none_valid

U = mja.Uniform
LARGE = mja.ArenaRanges(object_full_sizes=U(1.5, 2.0))  # of two objects on a table of 0.8 m
SMALL = mja.ArenaRanges(object_full_sizes=U(0.05, 0.1))


def fresh():
    """An arena that no one has drawn from: equal ones share what is compiled, and not what was looked at."""
    objects = [mja.Object("mug", "sphere", 0.06), mja.Object("cup", "sphere", 0.05)]
    return mja.TableArena(objects=objects)


@functools.cache
def template():
    return fresh().put_model("jax")


def keys(n=64):
    return mja.world_keys(0, range(n))


def said(arena, ranges, n=64, model=None):
    """The warnings of a draw, and its flags."""
    model = arena.put_model("jax") if model is None else model
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        valid = arena.randomize(model, keys(n), ranges).valid
    assert all(one.filename == __file__ for one in caught)
    return [str(one.message) for one in caught], np.asarray(valid)


def shelf():
    arena = mja.TableArena()
    arena.add_part(furniture.Bin("crate", pos=(2, 0, 0.8)))
    return arena


def jointed():
    """A slide whose margin must not be more than half of its range."""
    xml = """<mujoco><worldbody><body pos="0 0 1"><joint name="rail" type="slide" range="-1 1"/><geom size=".1"/></body>
    </worldbody></mujoco>"""
    arena = mja.Arena.from_xml(xml)
    arena.vary(limits=dr.Term("joint.range", ["rail"]), margin=dr.Term("joint.margin", ["rail"]))
    return arena


SAID = {
    "added": (
        shelf,
        {"terms": {"crate.pos": U([0.1, 0.1, 0.7], [0.3, 0.3, 0.7])}},
        r"World 0: .*'crate'.* overlap.*\. `ranges\.terms\.crate\.pos` of part 'crate' is between 0\.1 and 0\.3, far from the nominal "
        r"2: `relative='add'` may be meant\.",
    ),
    "factors": (
        fresh,
        {"object_full_sizes": U(1.5, 2.0)},
        r"World 0: Object 'mug' is 1\.\d+ x 1\.\d+ m, larger than table 0, which is 0\.8 x 0\.8 m\. "
        r"`ranges\.object_full_sizes` of object 'cup' is between 1\.5 and 2, far from the nominal 0\.05: "
        r"`relative='scale'` may be meant\.",
    ),
    "relative": (
        fresh,
        {"object_full_sizes": U(30, 40, relative="scale")},
        r"World 0: Object 'mug' is \d\.\d+ x \d\.\d+ m, larger than table 0, which is 0\.8 x 0\.8 m\.",
    ),
    "given numbers": (
        jointed,
        {"terms": {"limits": mja.Fixed([-0.1, 0.1]), "margin": mja.Fixed(0.3)}},
        r"World 0: .*",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", SAID)
def test_said(case):
    """The reason of `arena.problems`, and what may have been meant."""
    make, given, says = SAID[case]
    arena, ranges = make(), mja.ArenaRanges(**given)
    (found,), valid = said(arena, ranges)
    assert not valid.any()
    head = "`ranges` gives no valid world: none of the 64 that were drawn is. "
    assert found.startswith(head)
    assert re.fullmatch(says, found.removeprefix(head)), found
    world = arena.sample_params(keys()[0], ranges)
    assert found.removeprefix(head + "World 0: ").startswith(arena.problems(world, ranges)[0])


def test_commonest_reasons():
    """The commonest first, whichever comes first among the rules; what is rare is left out, and of one rule one object."""
    arena, n = fresh(), 16
    record, nominal = arena.record, jax.tree.map(np.asarray, arena.nominal_params())
    params = jax.tree.map(lambda x: np.stack([x] * n), nominal)
    params.object_masses[:9] = -1.0
    params.object_full_sizes[4:] = 2.0
    params.table_offsets[0] = np.nan
    found = none_valid.found(params, np.zeros(n, bool), record.rules, mja.ArenaRanges(), record.drawing, record.labels)
    problems = {w: arena.problems(mja.take(params, w)) for w in (0, 4)}
    assert [len(some) for some in problems.values()] == [2, 3]
    larger = next(one for one in problems[4] if "larger than table 0" in one)
    light = next(one for one in problems[0] if "object_masses" in one)
    assert found.numbers == {"n": n, "n_valid": 0, "why": f"World 4: {larger} World 0: {light}".removesuffix(".")}


@pytest.mark.slow
def test_few_worlds():
    """Of fewer than eight worlds it may be chance."""
    assert said(fresh(), LARGE, 7, template())[0] == []
    assert len(said(fresh(), LARGE, 8, template())[0]) == 1


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_some_valid_worlds(share):
    """Half of them are enough; of fewer the reasons are those of worlds that are not."""
    (messages, valid), n = (
        said(fresh(), mja.ArenaRanges(object_full_sizes=mja.Choice([0.1, 2.0], p=[share, 1 - share]))),
        64,
    )
    assert (valid.sum() < n / 2) == (share < 0.5)
    assert 0 < valid.sum() < n
    if share > 0.5:
        assert messages == []
        return
    (message,) = messages
    world = int(np.flatnonzero(~valid)[0])
    assert message.startswith(
        f"`ranges` gives few valid worlds: {valid.sum()} of the 64 that were drawn. World {world}: Object "
    )
    assert "larger than table 0" in message


@pytest.fixture
def looked(monkeypatch):
    """How often flags were looked at."""
    times, warn = [], none_valid.warn

    def counted(valid, *args):
        times.append(len(valid))
        warn(valid, *args)

    monkeypatch.setattr(none_valid, "warn", counted)
    return times


@pytest.mark.slow
def test_looked_at_once(looked):
    """Other numbers of the same structure do not wait for the device; other structures and numbers of worlds are compiled, too."""
    arena = fresh()
    for ranges, n in ((SMALL, 8), (SMALL, 8), (LARGE, 8), (SMALL, 9), (LARGE, 9)):
        assert said(arena, ranges, n, template())[0] == []
    assert looked == [8, 9]
    scaled = mja.ArenaRanges(object_full_sizes=U(30, 40, relative="scale"))
    assert [len(said(arena, scaled, 8, template())[0]) for _ in range(3)] == [1, 0, 0]
    assert looked == [8, 9, 8]


@pytest.mark.slow
def test_not_in_traces(looked):
    """Neither of keys, nor of ranges, nor of models."""
    arena, model = fresh(), template()
    jax.jit(lambda k: arena.randomize(model, k, LARGE).valid)(keys())
    jax.jit(lambda r: arena.randomize(model, keys(), r).valid)(LARGE)
    jax.jit(lambda g: arena.randomize(model.tree_replace({"opt.gravity": g}), keys(), LARGE).valid)(model.opt.gravity)
    jax.vmap(lambda k: arena.randomize(model, k, LARGE).valid)(keys().reshape(8, 8))
    assert looked == []


def test_no_implicit_transfers(looked):
    """Of all kinds that JAX forbids."""
    arena, model, all_keys = fresh(), template(), keys()
    jax.block_until_ready(arena.randomize(model, keys(), SMALL))
    scaled = mja.ArenaRanges(object_full_sizes=U(30, 40, relative="scale"))
    with jax.transfer_guard("disallow"), pytest.warns(UserWarning, match="gives no valid world"):
        arena.randomize(model, all_keys, scaled)
    with (
        jax.transfer_guard_device_to_host("disallow_explicit"),
        pytest.warns(UserWarning, match="gives no valid world"),
    ):
        fresh().randomize(model, all_keys, scaled)
    assert looked == [64, 64, 64]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [AxisType.Explicit, AxisType.Auto])
def test_on_several_devices(kind):
    """Worlds that are spread are looked at where this process has all of them."""
    arena = fresh()
    spread = NamedSharding(jax.make_mesh((4,), ("worlds",), axis_types=(kind,)), P("worlds"))
    spread_keys = jax.jit(lambda: jax.random.split(jax.random.key(1), 16), out_shardings=spread)()
    with pytest.warns(UserWarning, match=r"none of the 16 that were drawn is\. World 0: Object 'mug' is"):
        arena.randomize(template(), spread_keys, LARGE)
