"""Plots of what varies are of the worlds that they say."""

import jax
import jax.numpy as jnp
import numpy as np

import mjx_arenas as mja
from mjx_arenas.params import params as params_
from mjx_arenas.viz import plots, samples


def pair(n_worlds):
    """Worlds of two tables, of which the second varies only where it is absent."""
    arena = mja.MultiTableArena([[0, 0, 0.8], [2, 0, 0.8]])
    many = jax.tree.map(lambda x: jnp.stack([x] * n_worlds), arena.nominal_params())
    there = jnp.arange(n_worlds) % 2 == 0
    offsets = many.table_offsets.at[:, 1, 2].add(jnp.where(there, 0, jnp.arange(n_worlds) / 100))
    offsets = offsets.at[:, 0, 0].add(jnp.arange(n_worlds) / 100)
    params = many._replace(table_offsets=offsets, table_active=many.table_active.at[:, 1].set(there))
    return arena, jax.tree.map(np.asarray, params)


def test_absent_worlds_do_not_count():
    """The table and the plots agree: what differs only in worlds without the item does not vary."""
    arena, params = pair(8)
    columns = {c.name: c for c in samples.columns(arena.record, params)}
    varying = {name for name, column in columns.items() if column.varies}
    assert varying == {"table_offsets.table0.x", "table_active.table1"}
    said = arena.describe(params).varying
    assert {".".join(filter(None, (r.quantity, r.item, r.axis))) for r in said} == varying
    both = [columns["table_offsets.table0.x"], columns["table_offsets.table1.x"]]
    both[1] = both[1]._replace(values=np.where(both[1].there, params.table_offsets[:, 0, 0], 99))
    figure = plots.histograms(both, "8 worlds")
    assert figure.axes[0].get_xlim()[1] < 1  # no 99
    assert {text.get_text() for text in figure.axes[0].get_legend().get_texts()} == {"table0", "table1"}
    both[1] = columns["table_rots.table1"]._replace(values=both[1].values)
    scatter = plots.pairs(both, np.arange(8) < 6, "8 worlds").axes[1].collections
    assert [len(points.get_offsets()) for points in scatter] == [3, 1]  # of the four worlds with table1


def test_pairs_of_one_quantity():
    """Where one quantity varies its items are paired."""
    arena, params = pair(8)
    column = next(c for c in samples.columns(arena.record, params) if c.varies)
    other = column._replace(item="table1")
    figure = plots.pairs([column, other], np.ones(8, bool), "1,000 worlds")
    assert len(figure.axes) == 4
    assert figure.get_suptitle() == "Pairs of the numbers that vary,\nin 1,000 worlds"


def test_coverage_is_the_mean():
    """Over the worlds, of whether a place is covered; a table outside of the first worlds' grid, too."""
    arena, params = pair(5)
    image = plots.coverage(params, params_.on_host(arena.nominal_params()), arena.table_names, "5 worlds").axes[0]
    mesh = image.collections[0]
    share, corners = mesh.get_array(), mesh.get_coordinates()
    middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2
    want = np.zeros(share.shape)
    for world in range(5):
        covered = np.zeros(share.shape, bool)
        for t in np.flatnonzero(params.table_active[world]):
            half = params.table_full_sizes[world, t, :2] / 2
            covered |= (abs(middles - params.table_offsets[world, t, :2]) <= half).all(-1)
        want += covered / 5
    np.testing.assert_allclose(share, want, atol=1e-12)
    assert {0, 0.2, 0.6, 1} <= set(share.ravel().round(6))


def test_many_worlds(tmp_path, monkeypatch):
    """Of more worlds than are drawn, the first are, and the titles say so."""
    arena, params = pair(7)
    drawn = samples.Sample(0, np.arange(7), params, np.arange(7) != 1)
    titles = []

    class Drawn:
        def __init__(self, *_):
            titles.append(_[-1])

        def savefig(self, path):
            path.touch()

    sizes = []
    monkeypatch.setattr(
        plots, "coverage", lambda params, *rest, **_: sizes.append(len(params.table_rots)) or Drawn(*rest)
    )
    monkeypatch.setattr(
        plots, "histograms", lambda columns, of: sizes.extend(len(c.values) for c in columns) or Drawn(of)
    )
    for most, title in ((7, "7 worlds, 6 valid"), (4, "the first 4 of 7 worlds, 3 valid")):
        monkeypatch.setattr(plots, "DRAWN", most)
        plots.write(tmp_path / "plots", arena.record, samples.columns(arena.record, params), drawn)
        assert set(titles) == {title}
        assert set(sizes) == {most}
        titles.clear()
        sizes.clear()
