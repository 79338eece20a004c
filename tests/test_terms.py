"""The seam: a new term is one file, what it decides is proven when the arena is compiled, and two never decide the same."""

import dataclasses
import operator
import pathlib
import re

import jax
import mujoco
import numpy as np
import pytest
import worlds
from oracle import STRUCTURE_MAY_DIFFER, from_compiled

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.geometry import array_module
from mjx_arenas.params.params import Quantity
from mjx_arenas.terms.parts import Parts
from mjx_arenas.terms.term import Boxes, TermQuantity, places, row

FLAT = mujoco.mjtBuiltin.mjBUILTIN_FLAT


@dataclasses.dataclass(frozen=True)
class Boards:
    """A shelf board over each table, as long as the table is wide: all that a new family of parts has to say."""

    tables: tuple[str, ...]
    name = "boards"
    quantities = ()

    def edit(self, spec, params):
        for t, body in enumerate(self.tables):
            spec.geom(f"{body}_board").size = self._size(params)[t]

    def bind(self, model):
        return BoundBoards(self, np.array([model.geom(f"{t}_board").id for t in self.tables]), model.geom_size.shape)

    def _size(self, params):
        return params.table_full_sizes * np.array([0.5, 0.1, 0.2])


@dataclasses.dataclass(frozen=True)
class BoundBoards:
    """The boards of a compiled model."""

    term: Boards
    ids: np.ndarray
    shape: tuple[int, ...]
    depends = frozenset({"table_full_sizes"})

    def rows(self, params):
        size = (params.table_full_sizes * np.array([0.5, 0.1, 0.2], params.table_full_sizes.dtype))[: len(self.ids)]
        return [row("geom_size", places(self.shape, self.ids), size, self.depends)]


class WithBoards(Parts):
    """The registration."""

    @property
    def terms(self):
        return (*super().terms, Boards(tuple(t.body for t in self.tables)))


class Twice(Parts):
    """A term that decides what the tables decide."""

    @property
    def terms(self):
        return (*super().terms, Slabs(tuple(t.body for t in self.tables)))


class Slabs(Boards):
    """Boards that are the tables' own slabs."""

    name = "slabs"

    def bind(self, model):
        ids = np.array([model.geom(f"{t}_collision").id for t in self.tables])
        return BoundBoards(self, ids, model.geom_size.shape)

    def edit(self, spec, params):
        pass


class Forgets(Boards):
    """Boards of which nothing is written."""

    def bind(self, model):
        return BoundBoards(self, np.zeros(0, int), model.geom_size.shape)


class Forgetful(Parts):
    """A term whose rows are missing."""

    @property
    def terms(self):
        return (*super().terms, Forgets(tuple(t.body for t in self.tables)))


@dataclasses.dataclass(frozen=True)
class Paints(Boards):
    """Boards as wide as their texture is red, or of other files: pixels, which all worlds share."""

    change: str = "rgb1"

    def edit(self, spec, params):
        super().edit(spec, params)
        if self.change == "rgb1":
            spec.texture("oak").rgb1 = np.clip(self._size(params)[0], 0, 1)
        elif not np.array_equal(params.table_full_sizes, worlds.arena(2).record.nominal.table_full_sizes):
            spec.texture("oak").file = "ash.png"


def with_boards(kind):
    """Two tables with a massive board above each."""
    record = worlds.arena(2).record
    spec, parts = record.spec.copy(), kind(*(getattr(record.parts, f.name) for f in dataclasses.fields(Parts)))
    spec.add_texture(name="oak", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=FLAT, width=2, height=2)
    for table in record.table_names:
        body = spec.body(table).add_body(name=f"{table}_shelf", pos=(0, 0, 0.5))
        body.add_geom(name=f"{table}_board", type=mujoco.mjtGeom.mjGEOM_BOX, size=(1, 1, 1), mass=0)
        body.explicitinertial, body.mass, body.inertia = True, 1.0, (0.1, 0.1, 0.1)
        body.ipos = (0, 0, 0)
    if kind is not WithShares:
        Boards(tuple(record.table_names)).edit(spec, record.nominal)
    return mja.Arena(spec, parts, record.nominal)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            "rgb1",
            r"^`arena\.spec`: tex_data of texture 'oak' would be stale in other worlds: .* \(of 'boards'\), and nothing here derives it",
        ),
        (
            "file",
            r"^`arena\.spec`: texture 'oak' would have another file in other worlds, which share the pixels of all textures",
        ),
    ],
)
def test_a_term_that_paints(change, sentence):
    """Textures are the same in all worlds: a term that edits one is refused."""

    class Painting(Parts):
        @property
        def terms(self):
            return (*super().terms, Paints(tuple(t.body for t in self.tables), change))

    arena = with_boards(Painting)
    with pytest.raises(ValueError, match=sentence):
        arena.mj_model  # noqa: B018


SHARES = Quantity("table", (2,), float, "length, width", lambda x: x > 0, "> 0", (0.0, 10.0))


@dataclasses.dataclass(frozen=True)
class Shares(Boards):
    """Boards whose shares of the table are quantities of the term's own."""

    name = "shares"
    quantities = ("board_shares",)

    @property
    def numbers(self):
        nominal = np.tile([0.5, 0.1], (len(self.tables), 1))
        return (TermQuantity.of("board_shares", "board.shares", self.tables, SHARES, nominal),)

    def bind(self, model):
        return BoundShares(self, super().bind(model).ids, model.geom_size.shape)

    def _size(self, params):
        sizes, shares = params.table_full_sizes, params.terms["board_shares"]
        return array_module(sizes).concatenate([sizes[:, :2] * shares, sizes[:, 2:] / 5], axis=1)


class BoundShares(BoundBoards):
    """The boards of a compiled model."""

    depends = frozenset({"table_full_sizes", "board_shares"})

    def rows(self, params):
        return [row("geom_size", places(self.shape, self.ids), self.term._size(params), self.depends)]


class WithShares(Parts):
    """The registration."""

    @property
    def terms(self):
        return (*super().terms, Shares(tuple(t.body for t in self.tables)))


@pytest.mark.slow
def test_a_quantity_of_a_terms_own(monkeypatch):
    """The term's file and its registration say it all: it is drawn, ruled, called by its name, proven and written."""
    arena = with_boards(WithShares)
    name = "board_shares"
    assert arena.quantities == (name,)
    assert arena.elements(name) == ("table0", "table1")
    np.testing.assert_array_equal(arena.nominal_params().terms[name], np.float32([[0.5, 0.1]] * 2))
    ranges = mja.ArenaRanges(terms={name: mja.Uniform(0.5, 1.5, relative="scale")})
    model = arena.put_model("jax")
    batch = arena.randomize(model, mja.world_keys(0, range(2)), ranges)
    assert np.ptp(batch.params.terms[name], axis=0).all()
    for i in range(2):
        one = model.tree_replace({name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields})
        assert from_compiled(one, arena.compile(batch.world(i))) <= STRUCTURE_MAY_DIFFER.keys()

    params = arena.nominal_params()._replace(terms={name: np.float32([[0.5, 0.1], [0.5, 0.0]])})
    assert not arena.valid(params)
    sentence = "`terms.board_shares` of table 'table1' must be finite and > 0, got [0.5, 0.0]."
    assert arena.problems(params) == [sentence]
    with pytest.raises(ValueError, match=r"^`ranges\.terms\.board_shares"):
        arena.sample_params(mja.world_keys(0, [0])[0], mja.ArenaRanges(terms={name: mja.Uniform(-1, 1)}))

    monkeypatch.setattr(BoundShares, "depends", BoundBoards.depends)
    with pytest.raises(
        ValueError, match=r"`arena\.spec`: geom_aabb of geom 'table0_board' .* `board_shares` \(of 'shares'\)"
    ):
        with_boards(WithShares).mj_model  # noqa: B018


@pytest.mark.slow
@pytest.mark.slow_on("warp")
def test_a_new_term_is_written(impl):
    """Its elements, and the bounds and statistics that follow from them, are those of the recompiled world."""
    arena = with_boards(WithBoards)
    model = arena.put_model(impl)
    batch = arena.randomize(model, mja.world_keys(0, range(4)), worlds.RANGES)
    board = arena.mj_model.geom("table1_board").id
    assert np.ptp(np.asarray(batch.model.geom_size)[:, board], axis=0).all()
    assert np.ptp(np.asarray(batch.model.geom_rbound)[:, board]) > 0.05
    for i in range(4):
        one = model.tree_replace({name: np.asarray(operator.attrgetter(name)(batch.model))[i] for name in batch.fields})
        assert from_compiled(one, arena.compile(batch.world(i))) <= STRUCTURE_MAY_DIFFER.keys()


def test_a_new_term_stays_in_a_merged_arena():
    """An arena is added whose term was not registered: the boards of both are decided."""
    arena = with_boards(WithBoards).merge(with_boards(Parts), "other_", pos=(0, 9, 0))
    params = arena.sample_params(
        jax.random.key(0), mja.ArenaRanges(table_full_sizes=mja.Uniform([0.5, 0.5, 0.04], [0.9, 0.9, 0.06]))
    )
    one, again = arena.apply(arena.put_model("jax"), params), arena.compile(params)
    for board in (again.geom(name).id for name in ("table1_board", "other_table1_board")):
        assert not np.allclose(again.geom_size[board], arena.mj_model.geom_size[board])
        np.testing.assert_allclose(one.geom_size[board], again.geom_size[board], rtol=1e-6)


def test_quantities_that_fail_are_not_left_out():
    """An error in what a term says of its own quantities is raised, on every Python."""

    class Numbers(Boards):
        @property
        def numbers(self):
            return self.missing

    class WithNumbers(Parts):
        @property
        def terms(self):
            return *super().terms, Numbers(tuple(t.body for t in self.tables))

    with pytest.raises(AttributeError, match="missing"):
        with_boards(WithNumbers).nominal_params()


def test_the_worked_example():
    """The term in docs/house.md: worlds are those that the compiler makes."""
    text = (pathlib.Path(__file__).parent.parent / "docs" / "house.md").read_text()
    (block,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names = {"__name__": "house"}
    exec(compile(block, "docs/house.md", "exec"), names)
    arena, share = names["arena"], float(names["params"].terms["board_share"][0])
    assert 0.2 < share < 0.8 != share
    params = names["params"]._replace(table_full_sizes=np.float32([[0.6, 1.0, 0.04]]))
    one, again = arena.apply(arena.put_model("jax"), params), arena.compile(params)
    board = again.geom("table_board")
    np.testing.assert_allclose(board.size, [0.3 * share, 0.05, 0.02], rtol=1e-6)
    for field in ("geom_size", "geom_rbound", "geom_aabb"):
        np.testing.assert_allclose(getattr(one, field)[board.id], getattr(again, field)[board.id], rtol=1e-6)
    np.testing.assert_allclose(one.stat.extent, again.stat.extent, rtol=1e-6)


class Reaching(Boards):
    """Boards that say in closed form how far their bodies, the shelves, reach."""

    def bind(self, model):
        bound = super().bind(model)
        return BoundReaching(self, bound.ids, bound.shape, model.geom_bodyid[bound.ids])


@dataclasses.dataclass(frozen=True)
class BoundReaching(BoundBoards):
    """The boards of a compiled model, which hang half a metre above the middle of their tables."""

    bodies: np.ndarray
    far = 1.0  # times the right reach

    def boxes(self, params):
        xp = array_module(params.table_offsets)
        up = np.array([0, 0, 0.5], params.table_offsets.dtype)
        center = params.table_offsets - params.table_full_sizes * up + up
        reach = self.far * xp.linalg.norm(params.table_full_sizes * np.float32([0.5, 0.1, 0.2]), axis=-1)
        return Boxes(self.bodies, np.zeros(0, int), self.ids, center - reach[:, None], center + reach[:, None], reach)


class WithReaching(Parts):
    """Two terms, this one and the tables, that have closed forms of how far bodies reach."""

    @property
    def terms(self):
        return (*super().terms, Reaching(tuple(t.body for t in self.tables)))


@pytest.mark.slow
def test_two_terms_with_reaches():
    """Statistics count the closed forms of both: those of the recompiled world, and of wrong ones the arena is refused."""
    arena = with_boards(WithReaching)
    for key in mja.world_keys(0, range(3)):
        params = arena.sample_params(key, worlds.RANGES)
        one, again = arena.apply(arena.put_model("jax"), params), arena.compile(params)
        for name in ("center", "extent", "meansize"):
            np.testing.assert_allclose(getattr(one.stat, name), getattr(again.stat, name), rtol=1e-5, err_msg=name)


def test_a_wrong_reach_is_refused(monkeypatch):
    """A closed form that is off by 0.3 % is that of no compiled model."""
    monkeypatch.setattr(BoundReaching, "far", 1.003)
    with pytest.raises(
        ValueError, match=r"^The `boxes` of term 'boards' give body 'table0_shelf' another extent than the com"
    ):
        with_boards(WithReaching).mj_model  # noqa: B018


class ReachingTwice(Parts):
    """A term that says how far the tables reach, which say it themselves."""

    @property
    def terms(self):
        return (*super().terms, OfTables(tuple(t.body for t in self.tables)))


class OfTables(Reaching):
    """Boards whose bodies are the tables."""

    name = "shelves"

    def bind(self, model):
        return dataclasses.replace(super().bind(model), bodies=np.array([model.body(t).id for t in self.tables]))


def test_two_reaches_of_one_body():
    """The error names both terms and the body."""
    want = "Terms 'tables' and 'shelves' both decide how far body 'table0' reaches: leave it to one of them."
    with pytest.raises(ValueError, match=f"^{re.escape(want)}$"):
        with_boards(ReachingTwice).mj_model  # noqa: B018


def test_two_terms_on_one_element():
    """The error names both terms, the field and the element."""
    with pytest.raises(
        ValueError,
        match=r"^Term 'slabs' must leave out geom_size of geom 'table0_collision', which is of the arena's tables: ",
    ):
        with_boards(Twice).mj_model  # noqa: B018


class Otherwise(Boards):
    """Boards whose rows are not what their edit makes, by 0.3 %."""

    def bind(self, model):
        return BoundOtherwise(self, super().bind(model).ids, model.geom_size.shape)


class BoundOtherwise(BoundBoards):
    """The boards of a compiled model."""

    def rows(self, params):
        return [rows._replace(values=1.003 * rows.values) for rows in super().rows(params)]


class Contrary(Parts):
    """A term that contradicts itself."""

    @property
    def terms(self):
        return (*super().terms, Otherwise(tuple(t.body for t in self.tables)))


def test_a_term_that_writes_otherwise_than_it_edits():
    """In the nominal arena already: refused by the term and the element."""
    with pytest.raises(
        ValueError, match=r"^Term 'boards' writes another number to geom_size of geom 'table0_board' than its `edit` g"
    ):
        with_boards(Contrary).mj_model  # noqa: B018


def test_a_term_that_forgets_is_refused():
    """A board that is edited and not written refuses the arena, by the element, the quantity and the term."""
    want = (
        "`arena.spec`: geom_aabb of geom 'table0_board' would be stale in other worlds: it follows from `table_full_sizes` "
        "(of 'boards'), and nothing here derives it: give it explicit numbers, or keep it off what varies."
    )
    with pytest.raises(ValueError, match=f"^{re.escape(want)}$"):
        with_boards(Forgetful).mj_model  # noqa: B018


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass' is deprecated")
def test_what_follows_from_what_is_absent_is_refused():
    """Masses that are scaled to one total, of bodies of which one comes and goes."""
    arena = mja.Arena.from_xml(
        """<mujoco><compiler settotalmass="5"/><worldbody><body name="stays"><joint/><geom type="box" size=".1 .2 .3"/></body>
        <body name="goes" pos="1 0 0"><joint/><geom size=".2"/></body></worldbody></mujoco>"""
    )
    arena.vary(there=dr.Term("body.active", "goes"))
    want = (
        r"^`arena\.spec`: body_\w+ of what is present would differ where other tables or objects are absent, because the compiler "
        r"derives it from them: give it explicit numbers\.$"
    )
    with pytest.raises(ValueError, match=want):
        arena.mj_model  # noqa: B018


def test_dampratio_is_refused_for_what_it_is():
    """The `dampratio` of an actuator on a site, under a varying mass: the message says so, not that something stands elsewhere."""
    arena = mja.TableArena(objects=[mja.Object("cart", "mjcf", file=CART)])
    with pytest.raises(ValueError, match=r"actuator_biasprm of actuator 'cart_drive' would be stale") as error:
        arena.mj_model  # noqa: B018
    assert "`object_masses` (of 'objects')" in str(error.value)
    assert "the compiler makes a damping of its `dampratio`: give it a `kv`." in str(error.value)


CART = mujoco.MjSpec.from_string(
    """<mujoco><worldbody><body name="base"><geom size=".05 .05 .02" type="box"/><body name="bob" pos="0 0 .1"><joint name="slide"
    type="slide"/><geom size=".02"/><site name="s"/></body></body></worldbody><actuator>
    <position name="drive" site="s" gear="0 0 1 0 0 0" kp="10" dampratio="1"/></actuator></mujoco>"""
)


def test_small_inertias_are_written(impl):
    """A crumb of a millimetre and milligrams has its own inertia: compared relative to itself, not to 1 kg m^2."""
    arena = mja.TableArena(objects=[mja.Object("crumb", "box", full_size=0.001)])
    model = arena.put_model(impl)
    batch = arena.randomize(model, mja.world_keys(0, [0]), mja.ArenaRanges(object_masses=mja.Fixed(4e-6)))
    assert batch.valid.all()
    assert "body_inertia" in batch.fields
    want = arena.compile(batch.world(0)).body("crumb").inertia
    np.testing.assert_allclose(batch.model.body_inertia[0, arena.layout.object_body[0]], want, rtol=1e-6)


@pytest.mark.slow
def test_tied_draws_do_not_go_with_the_first_object():
    """Removing object "a" changes nothing about "b", tied or not."""
    ranges = mja.ArenaRanges(
        object_masses=mja.Uniform(0.1, 0.3, tied=True),
        object_frictions=mja.Uniform(1.1, 2.0, tied=(True, False, False)),
        object_tables=mja.Choice([0, 1], tied=True),
    )
    both, one = (
        mja.MultiTableArena(worlds.offsets(2), table_priority=0, objects=[mja.Object(name) for name in names])
        for names in ("ab", "b")
    )
    for key in mja.world_keys(0, range(6)):
        p, q = both.sample_params(key, ranges), one.sample_params(key, ranges)
        for name in ("object_masses", "object_frictions", "object_tables"):
            np.testing.assert_array_equal(getattr(p, name)[1], getattr(q, name)[0], err_msg=name)
        assert p.object_masses[0] == p.object_masses[1]
        assert p.object_frictions[0, 0] == p.object_frictions[1, 0]
        assert p.object_tables[0] == p.object_tables[1]
