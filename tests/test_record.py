"""Equal arenas are one record: they share all that is compiled, and what is compiled for arenas that are gone can be freed."""

import gc
import pathlib
import weakref

import jax
import mujoco
import numpy as np

import mjx_arenas as mja

DATA = pathlib.Path(__file__).parent / "data"
RANGES = mja.ArenaRanges(table_rots=mja.Uniform(-0.5, 0.5), object_masses=mja.Uniform(0.1, 0.3))


def ball(**kwargs):
    """The arena that compiles fastest."""
    return mja.TableArena(objects=[mja.Object("ball", "sphere", 0.06)], **kwargs)


def used(arena):
    """Made, randomized, stepped and checked: all that a loop does with an arena."""
    keys = jax.random.split(jax.random.key(0), 3)
    batch = arena.randomize(arena.put_model("jax"), keys, RANGES)
    jax.block_until_ready(mja.rollout(batch, mja.make_data(batch, keys), 2))
    arena.valid(batch.world(0))
    arena.place(batch.world(0), keys[0])
    arena.fields(arena.put_model("jax"), batch.world(0))
    return batch


def test_a_second_equal_arena_compiles_nothing():
    """Neither traces nor compiles: counted by JAX's own events."""
    first, events = used(ball()), []

    def count(name, *args, **kwargs):
        events.extend([name] if name.startswith("/jax/core/compile") else [])

    jax.monitoring.register_event_duration_secs_listener(count)
    try:
        second = used(ball())
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
    slow = ball()
    slow.mj_model.opt.timestep = 0.001
    assert len({arena.record.digest for arena in (ball(), named, heavier, elsewhere, slow)}) == 5


def test_options_set_later_make_another_record():
    """Options of the compiled model may change until `put_model`, and what was compiled with others is not used."""
    arena = ball()
    before = arena.record
    arena.mj_model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    assert arena.record != before
    assert before.mj_model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert arena.record is arena.record


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
