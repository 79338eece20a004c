"""The furnished examples: every world that is drawn can be, its objects find places, and the names in the files are those of the arena."""

import jax
import numpy as np
import pytest

import mjx_arenas as mja

ROOMS = ("kitchen", "bin_picking")
MORE = ("warehouse", "workshop", "living_room")


@pytest.mark.slow
@pytest.mark.parametrize("name", [*ROOMS, *(pytest.param(name, marks=pytest.mark.xslow) for name in MORE)])
def test_worlds(name):
    arena, ranges = mja.load(name)
    keys = mja.world_keys(0, range(64))

    @jax.jit
    @jax.vmap
    def drawn(key):
        params = arena.sample_params(key, ranges)
        return params, arena.valid(params, ranges), arena.place(params, key).valid

    params, valid, placed = drawn(keys)
    assert valid.all()
    assert np.mean(placed) > 0.99
    if ranges.object_tables is not None:
        assert len(np.unique(params.object_tables)) >= 3


def test_unknown_names(tmp_path):
    """A surface or a variant that there is not is answered with its line and what there is."""
    (tmp_path / "room.yaml").write_text(
        """arena:
  type: TableArena
  objects: [{name: thing, variants: [{name: mug}, {name: can}]}]
  then:
    - add_part: {part: {Shelf: {name: rack, pos: [1.5, 0, 0]}}}
ranges:
  object_tables: {Choice: [table, rack_bord1]}
  terms:
    thing.variant: {Choice: [mug, cup]}
"""
    )
    with pytest.raises(ValueError, match="2 problems") as raised:
        mja.load(tmp_path / "room.yaml")
    _, first, second = str(raised.value).splitlines()
    assert first.endswith(
        "room.yaml:7: `ranges.object_tables.Choice[1]` must be a surface of the arena or its number, got 'rack_bord1': did you mean "
        "`rack_board1`?"
    )
    assert (
        "room.yaml:9: `ranges.terms.thing.variant.Choice[1]` must be a variant of the arena or its number, got 'cup'"
        in second
    )
