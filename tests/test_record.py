"""Equal arenas are one record: they share all that is compiled, and what is compiled for arenas that are gone can be freed."""

import copy
import dataclasses
import gc
import pathlib
import pickle
import threading
import warnings
import weakref
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import mujoco
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas.furniture.part import LENGTH, Box, Part, whole

DATA = pathlib.Path(__file__).parent / "data"
RANGES = mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 0.5), object_masses=mja.Uniform(0.1, 0.3))


def ball(**kwargs):
    """The arena that compiles fastest."""
    return mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)], **kwargs)


def drawn(arena, impl):
    """Randomized and looked at: what a loop does before it steps."""
    batch = arena.randomize(arena.put_model(impl), jax.random.split(jax.random.key(0), 3), RANGES)
    arena.valid(batch.world(0))
    return jax.block_until_ready(batch)


def used(arena, impl):
    """Made, randomized, stepped and checked: all that a loop does with an arena."""
    keys = jax.random.split(jax.random.key(0), 3)
    batch = drawn(arena, impl)
    jax.block_until_ready(mja.rollout(batch, mja.make_data(batch, keys), 2))
    arena.place(batch.world(0), keys[0])
    arena.fields(arena.put_model(impl), batch.world(0))
    return batch


@pytest.mark.parametrize("n", [1, 2000])
def test_every_number_of_a_quantity_counts(n):
    """In the twelfth digit, and in the middle of many."""
    record, x = ball().record, np.ones(n)
    y = np.where(np.arange(n) == n // 2, 1 + 1e-12, x)
    one, same, other = (
        dataclasses.replace(record, nominal=record.nominal._replace(terms={"x": values})) for values in (x, x.copy(), y)
    )
    assert one == same
    assert one != other


@pytest.mark.slow
@pytest.mark.parametrize("impl", ["jax", "warp"])
@pytest.mark.parametrize("use", [drawn, pytest.param(used, marks=pytest.mark.slow)])
def test_a_second_equal_arena_compiles_nothing(use, impl):
    """Neither traces nor compiles: counted by JAX's own events."""
    first, events = use(ball(), impl), []

    def count(name, *args, **kwargs):
        events.extend([name] if name.startswith("/jax/core/compile") else [])

    jax.monitoring.register_event_duration_secs_listener(count)
    try:
        second = use(ball(), impl)
        assert events == []
        jax.jit(lambda x: x + 1)(0.5)
        assert events  # they do count
    finally:
        jax.monitoring.unregister_event_duration_listener(count)
    assert second.record == first.record
    assert second.record is not first.record
    assert hash(jax.tree.structure(second)) == hash(jax.tree.structure(first))


def test_other_arenas_are_other_records():
    """What changes a model, its options, its names or what varies about it makes another record."""
    plain = ball().record
    assert plain == ball().record
    named = mja.TableArena(objects=[mja.Object("bowl", "sphere", 0.06)])
    heavier = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06, mass=0.2)])
    elsewhere = mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06, pos=(0.1, 0))])
    ring: dict[str, Any] = {"near": (0.2, 0), "distance": (0, 0.6)}
    places = [ring, ring | {"near": (0.25, 0)}, ring | {"near": "table"}, ring | {"distance": (0, 0.5)}]
    near = [mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06, place=mja.Place(**one))]) for one in places]
    slow = ball()
    slow.mj_model.opt.timestep = 0.001
    assert len({arena.record.digest for arena in (ball(), named, heavier, elsewhere, slow, *near)}) == 9


def post(share):
    """An arena with a part whose second size follows otherwise from its first, and is the same nominally."""

    @dataclasses.dataclass(frozen=True)
    class Post(Part):
        size: float = 0.4

        @property
        def own(self):
            return {"size": whole(LENGTH, self.size)}

        def boxes(self, numbers):
            return [Box("post", (0.0, 0.0, 0.5), (0.1, share * (numbers["size"] - 0.4) + 0.2, 0.5))]

    arena = ball()
    arena.add_part(Post("post", pos=(-2, 0, 0)))
    return arena


def test_a_class_of_the_same_name_makes_another_record():
    """As in a notebook in which a part was defined again: what was compiled for the first is not used for the second."""
    half, third = post(0.5), post(0.3)
    for arena, share in ((half, 0.5), (third, 0.3)):
        params = arena.nominal_params()
        params = params._replace(terms=params.terms | {"post.size": np.float32([0.6])})
        one = arena.apply(arena.put_model("jax"), params)
        size = arena.compile(params).geom("post_post").size
        np.testing.assert_allclose(size[1], 0.2 * share + 0.2, rtol=1e-6)
        np.testing.assert_allclose(one.geom_size[arena.mj_model.geom("post_post").id], size, rtol=1e-6)
    assert half.record != third.record


def test_how_it_is_written_makes_no_other_record():
    """Lists or tuples, NumPy's numbers, a table by its name."""
    ways = ({"pos": (0.1, 0.0)}, {"pos": [np.float64(0.1), 0]}, {"pos": np.array([0.1, 0.0]), "on": "table"})
    sizes = (0.06, [0.06] * 3, np.float64(0.06))
    made = [
        mja.TableArena(objects=[mja.Object("ball", "sphere", x, **kwargs)])
        for x, kwargs in zip(sizes, ways, strict=True)
    ]
    assert len({arena.record.digest for arena in made}) == 1


def test_options_set_later_make_another_record():
    """Options of the compiled model may change until `put_model`, and what was compiled with others is not used."""
    arena = ball()
    before = arena.record
    arena.mj_model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    assert arena.record != before
    assert before.mj_model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert arena.record is arena.record


def test_options_set_after_the_template():
    """What is made before and after has other options, which is said once, and no more after the next `put_model`."""
    arena = ball()
    model, params = arena.put_model("jax"), arena.nominal_params()
    arena.mj_model.opt.timestep, arena.mj_model.opt.gravity[2] = 0.001, -1
    with pytest.warns(UserWarning, match=r"^`arena\.mj_model\.opt`") as told:
        assert arena.compile(params).opt.timestep == 0.001
    assert [str(w.message) for w in told] == [
        (
            "`arena.mj_model.opt`: gravity, timestep changed since the last `put_model`. Existing templates and batches "
            "keep the old values, and newly compiled worlds have the new ones."
        )
    ]
    assert told[0].filename == __file__
    with warnings.catch_warnings(record=True) as again:
        warnings.simplefilter("always")
        arena.compile(params)
        assert arena.put_model("jax").opt.timestep == np.float32(0.001)
        arena.compile(params)
        arena.mj_model.opt.timestep = 0.002  # as the first template
        assert not again
        with pytest.warns(UserWarning, match="timestep changed since"):
            arena.batch(model, jax.tree.map(lambda x: x[None], params))


def test_one_arena_in_many_threads():
    """All have the same model, of which each compiles worlds."""
    arena, together = ball(), threading.Barrier(4)
    params = jax.tree.map(np.asarray, arena.nominal_params())

    def use(_):
        together.wait()
        for turn in (0.1, 0.2, 0.3):
            arena.check_ranges(mja.ArenaRanges(table_rots=mja.Uniform(-turn, turn)))
            assert arena.compile(params).nbody == arena.mj_model.nbody
            assert arena.xml.startswith("<mujoco")
        return arena.mj_model, arena.record

    with ThreadPoolExecutor(4) as threads:
        models, records = zip(*threads.map(use, range(4)), strict=True)
    assert all(model is arena.mj_model for model in models)
    assert all(record is arena.record for record in records)


@pytest.mark.parametrize("compiled", [False, True])
@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_copies(copied, compiled):
    """A copy of an arena is equal, shares what is compiled, and is its own."""
    arena = ball()
    if compiled:
        arena.mj_model.opt.timestep = 0.001
        arena.put_model("jax")
    other = copied(arena)
    assert other.record == arena.record
    assert (other.record is arena.record) == compiled
    assert other.compile(other.nominal_params()).opt.timestep == arena.mj_model.opt.timestep
    other.mj_model.opt.timestep = 0.005
    assert arena.mj_model.opt.timestep == (0.001 if compiled else 0.002)
    attached = copied(ball())
    attached.attach('<mujoco><worldbody><body name="b"><geom size=".1"/></body></worldbody></mujoco>', pos=(0, 0, 3))
    assert attached.mj_model.nbody == arena.mj_model.nbody + 1


def test_copies_of_batches():
    """Arrays are copied, the record is shared."""
    arena = ball()
    batch = arena.batch(arena.put_model("jax"), jax.tree.map(lambda x: x[None], arena.nominal_params()))
    other = copy.deepcopy(batch)
    assert other.record is batch.record
    assert jax.tree.structure(other) == jax.tree.structure(batch)
    assert jax.tree.all(jax.tree.map(lambda a, b: bool((np.asarray(a) == np.asarray(b)).all()), other, batch))


def test_pickles_are_refused():
    """MJCF, as which a spec could be pickled, has not all digits."""
    arena = ball()
    batch = arena.batch(arena.put_model("jax"), jax.tree.map(lambda x: x[None], arena.nominal_params()))
    for what in (arena, arena.record, batch):
        with pytest.raises(
            TypeError, match=r"cannot be pickled, because MJCF keeps only six digits: mjx_arenas\.save .*\.$"
        ):
            pickle.dumps(what)


@pytest.mark.slow
def test_what_is_compiled_can_be_freed():
    """After `jax.clear_caches` nothing holds the record of an arena that is gone."""
    arena = mja.TableArena(objects=[mja.Object("gone", "sphere", 0.06)])
    keys = jax.random.split(jax.random.key(0), 2)
    batch = arena.randomize(arena.put_model("jax"), keys, RANGES)
    mja.make_data(batch, keys)
    record = weakref.ref(batch.record)
    del arena, batch
    jax.clear_caches()
    gc.collect()
    assert record() is None


def test_arrays_of_objects_count():
    """Arrays that are equal but for one number make other records."""
    one, two = (
        mja.MultiTableArena([[0, 0, 0.8], [0, x, 0.8]], objects=[mja.Object("a", "mjcf", file=DATA / "drawer.xml")])
        for x in (1.5, np.nextafter(1.5, 2))
    )
    assert one.record != two.record


@pytest.mark.slow
def test_no_template_is_kept():
    """A template goes with its last user, whatever was made of it, and so do its arrays, with the last batch that has them."""
    arena, four = ball(), jax.sharding.Mesh(np.array(jax.devices()[:4]), "worlds")
    keys, spread = mja.world_keys(0, range(4)), jax.sharding.NamedSharding(four, jax.sharding.PartitionSpec("worlds"))
    for these in (keys, jax.device_put(keys, spread)):
        model = arena.put_model("jax")
        alive, array = weakref.ref(model), weakref.ref(model.geom_solref)
        batch = arena.randomize(model, these, RANGES)
        del model
        gc.collect()
        assert alive() is None
        del batch
        gc.collect()
        assert array() is None
