"""What is said of terms: of contact pairs, of quantities with names of other things, and of names that MJX has."""

import jax
import numpy as np
import pytest

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.params.params import with_values

PAIRS = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
<body name="toe" pos="0 0 .1"><freejoint/><geom name="toe" size=".1"/></body>
<body name="heel" pos="1 0 .1"><freejoint/><geom name="heel" size=".1"/></body></worldbody>
<contact><pair name="to" geom1="floor" geom2="toe"/><pair name="he" geom1="floor" geom2="heel"/></contact></mujoco>"""


def nominal(arena):
    return jax.tree.map(np.asarray, arena.nominal_params())


def test_contact_pairs_by_their_names():
    """In ranges and in worlds, of one pair and of all."""
    arena = mja.Arena.from_xml(PAIRS)
    arena.vary(
        grip=dr.Term("pair.friction", axes="sliding"), margin=dr.Term("pair.margin", "to"), gap=dr.Term("pair.gap")
    )
    said = "`ranges.terms.margin` of pair 'to' can reach -1.0: it must stay >= 0 [m]."
    both = "`ranges.terms.gap` of all pairs can reach -1.0: it must stay >= 0 [m]."
    for ranges, sentence in (({"margin": mja.Uniform(-1, 1)}, said), ({"gap": mja.Uniform(-1, 1)}, both)):
        with pytest.raises(ValueError, match=r"can reach") as raised:
            arena.check_ranges(mja.ArenaRanges(terms=ranges))
        assert str(raised.value) == sentence
    bad = np.array([[1.0] * 5, [-1.0, 1, 1, 1, 1]])
    problem = "`terms.grip` of pair 'he' must be finite and >= 0 on every axis, got [-1.0, 1.0, 1.0, 1.0, 1.0]."
    assert arena.problems(with_values(nominal(arena), {"grip": bad})) == [problem]


@pytest.mark.parametrize("name", ["pair", "tables", "table", "object", "any", "world", "term"])
def test_quantities_called_like_kinds(name):
    """A name of a quantity is no kind of thing to the rules."""
    arena = mja.TableArena(objects=[mja.Object("cube")])
    arena.attach(PAIRS, "a_")
    arena.vary(**{name: dr.Term("pair.margin")})
    params = nominal(arena)
    assert arena.problems(params) == []
    bad = with_values(params, {name: np.array([0.0, -1.0])})
    assert arena.problems(bad) == [f"`terms.{name}` of pair 'a_he' must be finite and >= 0 [m], got -1.0."]
