"""What pictures take of memory, against what Warp counts of its own allocations; and what is refused before Warp draws without room."""

import numpy as np
import pytest
import warp
from test_pixels import small_worlds

import mjx_arenas as mja
from mjx_arenas.pixels import contexts, memory
from mjx_arenas.pixels.order import Order

ON_GPU = 2 * 4  # bytes a geom that is drawn: the counts of its nodes, which Warp has on GPUs alone
TREE = 2 * (16 + 16 + 4) + 4  # the same on the CPU, where it is built a second time in other order
KINDS = {
    "rgb": {},
    "with depth": {"depth": True},
    "segmentation": {"rgb": False, "segmentation": True},
    "all, two cameras": {"depth": ["frontview"], "segmentation": True},
    "other groups": {"groups": (0,)},
}


@pytest.fixture(scope="module")
def small():
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.spec.worldbody.add_geom(name="unseen", size=[0.1, 0, 0], pos=[2, 2, 0.1], rgba=[0, 0, 0, 0])
    return arena


def counted(drawing, n):
    """(kept, most) bytes that Warp allocates for `n` worlds."""
    with warp.ScopedMemoryTracker(print=False):
        core = warp._src.context.runtime.core
        core.wp_alloc_tracker_reset()
        settings = {"enabled_geom_groups": list(drawing.groups), "use_textures": False}
        made = contexts.context(drawing.record, n, drawing.cameras, Order.of(drawing.record), settings)
        kept, most = core.wp_alloc_tracker_get_current_bytes(), core.wp_alloc_tracker_get_peak_bytes()
    del made
    return np.array([kept, most])


@pytest.mark.parametrize("case", KINDS)
def test_bytes_are_those_that_warp_allocates(small, case):
    drawing = small.renderer({"agentview": (16, 12), "frontview": (24, 8)}, **KINDS[case])
    each = memory.of_world(drawing.record, drawing.cameras, drawing.groups)
    counted(drawing, 1)  # what is kept for all contexts
    one, other = 64, 192
    kept, most = (counted(drawing, other) - counted(drawing, one)) / (other - one)
    model = small.mj_model
    drawn = int((np.isin(model.geom_group, drawing.groups) & (model.geom_rgba[:, 3] > 0)).sum())
    assert 0 < drawn < model.ngeom
    assert kept == each.kept - ON_GPU * drawn
    assert abs(most - each.made) <= (ON_GPU + TREE) * drawn


def test_what_jax_still_takes(small, monkeypatch):
    """Where JAX does not hold its share yet, what it needs for the pictures is not free for Warp."""
    drawing = small.renderer({"agentview": (32, 48)})
    each = memory.of_world(drawing.record, drawing.cameras, drawing.groups)
    room = 300 * each.made + 1
    monkeypatch.setattr(memory, "memory", lambda: memory.Memory(1e12, room))
    memory.check(300, each)
    monkeypatch.setattr(memory, "memory", lambda: memory.Memory(1e12, room, 0.0))
    with pytest.raises(ValueError, match=r"^The ray caster needs"):
        memory.check(300, each)


SAYS = {
    "on the CPU": (
        memory.Memory(4e6, None),
        r"^Pictures of 300 worlds need 0.005\d* GB, and the device has 0.004 GB: draw fewer worlds, cameras or pixels at a time\.$",
    ),
    "for JAX": (memory.Memory(1e6, 1e12), r"^Pictures of 300 worlds need 0.00\d+ GB, and the device has 0.001 GB: "),
    "for Warp": (
        memory.Memory(1e12, 1e6),
        r"^The ray caster needs 0.00\d+ GB for 300 worlds, and the GPU has 0.001 GB beside what JAX holds: draw fewer worlds",
    ),
}


@pytest.mark.parametrize("case", SAYS)
def test_more_than_memory_holds(small, case, monkeypatch):
    """Before anything is allocated; what fits is not refused."""
    has, says = SAYS[case]
    drawing = small.renderer({"agentview": (32, 48)})
    each = memory.of_world(drawing.record, drawing.cameras, drawing.groups)
    assert each.pictures == 32 * 48 * 7
    monkeypatch.setattr(memory, "memory", lambda: has)
    memory.check(20, each)
    with pytest.raises(ValueError, match=says):
        memory.check(300, each)


@pytest.mark.slow
def test_it_is_asked_before_anything_is_drawn(small, monkeypatch):
    """And what Warp does not find in spite of it is a sentence, too."""
    batch, data = small_worlds(small, 3)
    drawing = small.renderer({"agentview": (16, 13)})
    with monkeypatch.context() as given:
        given.setattr(memory, "memory", lambda: memory.Memory(4000.0, None))
        with pytest.raises(
            ValueError, match=r"^Pictures of 3 worlds need \S+ GB, and the device has 4e-06 GB: draw fewer"
        ):
            drawing(batch, data)

    def full(*given):
        raise RuntimeError("Failed to allocate 123456789 bytes on device 'cuda:0'")

    monkeypatch.setattr(contexts, "context", full)
    with pytest.raises(MemoryError, match=r"^Warp found no 123 MB on the GPU beside what JAX holds: set "):
        drawing(batch, data)


def test_what_the_device_has():
    """Of a CPU its memory, which both share."""
    has = memory.memory()
    assert has.beside is None
    assert 1e9 < has.jax < 1e13
