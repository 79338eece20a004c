"""The words of problems: what a stranger reads, compared with a file; and how problems travel in errors and warnings."""

import pathlib
import string
import warnings

import jax
import mujoco
import numpy as np
import pytest
from refused import DATA, OFFSETS, host, open_arena

import mjx_arenas as mja
from mjx_arenas import dr, settings
from mjx_arenas.pixels import memory
from mjx_arenas.problem import Problem, Source, in_world, problem, under
from mjx_arenas.problems import messages
from mjx_arenas.problems.sentences import SENTENCES

GOLDEN = DATA / "messages.txt"
FILE = """arena:
  type: MultiTableArena
  table_offsets: [[0, -0.6, 0.8], [0, 0.6, 0.8]]
  table_rotz: 1
  objects:
    - {name: cube, full_size: -1}
    - {name: ball, on: desk}
ranges:
  table_rots: {Uniform: [1, 0]}
  has_legs: {Bernouli: 0.5}
"""
RANGES = """arena: {type: TableArena}
ranges:
  has_legs: {Uniform: {low: 0, high: 1}}
  table_offsets: {Uniform: {low: [0, 0], high: 1}}
"""
MADE = """arena:
  type: TableArena
  objects:
    - {name: dice, type: cube}
ranges:
  table_offsets: {Uniform: {low: 0, high: 1, relative: times}}
"""
SCENE = (
    '<mujoco><worldbody><body name="desk"><geom name="leg" type="cylinder" size=".1 .1"/></body></worldbody></mujoco>'
)
SLAB = (
    '<mujoco><worldbody><body name="desk"><geom type="box" size=".1 .1 .02" pos="0 0 .5"/></body></worldbody></mujoco>'
)
ROBOT = '<mujoco><worldbody><body name="base"><geom size=".1"/></body></worldbody></mujoco>'


def ranges(**given):
    open_arena().check_ranges(mja.ArenaRanges(**given))


def world(**values):
    one = open_arena()
    raise ValueError(
        " ".join(one.problems(host(one, **values), mja.ArenaRanges(workspace=mja.Workspace((-1, -2), (1, 2)))))
    )


def file(text):
    path = pathlib.Path("arena.yaml")
    path.write_text(text)
    mja.load(path)


def multi(**given):
    mja.MultiTableArena(**{"table_offsets": OFFSETS} | given)


def one(**given):
    mja.TableArena(objects=[mja.Object("mug", **given)])


MESSAGES = {
    "a number for each table": lambda: multi(table_rots=[0, 1]),
    "numbers that are none": lambda: multi(table_full_sizes=[(0.8, 0.8, 0.05), (0.8, 0.8), (1, 1, 1)]),
    "a negative size of one table": lambda: multi(table_full_sizes=[(1, 1, 0.1), (1, 1, 0.1), (0.4, -0.1, 0.02)]),
    "a friction of all tables": lambda: multi(table_frictions=(-1, 0, 0)),
    "no room for legs": lambda: mja.TableArena(table_offset=(0, 0, 0)),
    "far away": lambda: mja.TableArena(table_offset=(0, 0, 1e30)),
    "one object, no list": lambda: mja.TableArena(objects=mja.Object("mug")),
    "an object's table": lambda: multi(objects=[mja.Object("mug", on="desk")]),
    "an object on nothing": lambda: mja.Arena.from_xml("<mujoco/>", objects=[mja.Object("mug")]),
    "an object's shape": lambda: one(type="capsule", full_size=0.1),
    "an object's type": lambda: one(type="ball"),
    "an object's file": lambda: one(type="mesh", file="mug.obj"),
    "mass and density": lambda: one(mass=0.1, density=500),
    "larger than its table": lambda: one(full_size=1.5),
    "several": lambda: multi(table_rots="a", has_legs="no", objects=[mja.Object("c", condim=2, mass=True)]),
    "an MJCF that is not there": lambda: mja.TableArena(xml="scene.xml"),
    "a table of a scene": lambda: mja.Arena.from_xml(SCENE, ["desk"]),
    "a robot's table": lambda: open_arena().attach(ROBOT, on=7),
    "a robot on nothing": lambda: mja.Arena.from_xml("<mujoco/>").attach(ROBOT, on=4),
    "a choice of nothing": lambda: ranges(table_rots=mja.Choice([])),
    "a seed for a key": lambda: open_arena().sample_params(5, mja.ArenaRanges()),
    "a key for keys": lambda: open_arena().randomize(
        open_arena().put_model("jax"), jax.random.key(0), mja.ArenaRanges()
    ),
    "another arena's model": lambda: open_arena().apply(
        mja.TableArena().put_model("jax"), open_arena().nominal_params()
    ),
    "many worlds for one": lambda: open_arena().compile(jax.tree.map(lambda x: np.stack([x, x]), host(open_arena()))),
    "no distribution": lambda: ranges(table_rots=(0, 1)),
    "a distribution's shape": lambda: ranges(table_full_sizes=mja.Uniform([0.1, 0.2], 0.4)),
    "a value beside a shape": lambda: multi(table_offsets=[0, 0, 0.8], table_frictions=(-1, 0, 0)),
    "a tiny size": lambda: ranges(object_full_sizes=mja.LogUniform(1e-20, 0.1)),
    "how a distribution meets the nominal value": lambda: mja.Uniform(0.8, 1.2, relative="plus"),
    "a distribution's order": lambda: ranges(table_rots=mja.Uniform(1, -1)),
    "numbers for truths": lambda: ranges(has_legs=mja.Uniform(0, 1)),
    "what can be reached": lambda: ranges(object_masses=mja.Uniform(-0.1, 0.1)),
    "legs that can be reached": lambda: ranges(table_full_sizes=mja.Uniform(0.1, 2.0)),
    "a workspace": lambda: ranges(workspace=mja.Workspace([1, 1], [-1, -1])),
    "a world": lambda: world(object_masses=[np.nan], table_frictions=-np.ones((3, 3))),
    "tables of a world": lambda: world(table_offsets=[[0, -0.3, 0.8], [0, 0, 0.8], [0, 3, 0.8]]),
    "a table of a scene that is too small": lambda: mja.Arena.from_xml(
        SLAB, ["desk"], objects=[mja.Object("mug", full_size=0.3)]
    ),
    "a file": lambda: file(FILE),
    "ranges of a file": lambda: file(RANGES),
    "what cannot be made of a file": lambda: file(MADE),
}


def rendered(tmp_path, monkeypatch):
    """All messages as the file has them."""
    monkeypatch.chdir(tmp_path)
    found = []
    for name, call in MESSAGES.items():
        with pytest.raises((ValueError, OSError)) as raised:
            call()
        found.append(f"# {name}\n{raised.value}\n")
    return "\n".join(found)


def test_messages(tmp_path, monkeypatch):
    """As in tests/data/messages.txt, to the letter."""
    assert rendered(tmp_path, monkeypatch) == GOLDEN.read_text()


def test_every_rule_has_a_sentence():
    """It is one: a whole one, whose fields have names."""
    for rule, text in SENTENCES.items():
        assert all(field is None or field.isidentifier() for _, field, _, _ in string.Formatter().parse(text)), rule
        assert (
            rule in ("said", "unread", "uncompiled", "uncompiled_world", "unattached", "unread_mjcf")
            or text[-1] in ".?"
            or text.endswith("{nearest}")
        ), rule


def test_many_problems():
    """An error lists the first ones, each once."""
    with pytest.raises(ValueError, match=r"^100 problems in MultiTableArena:\n") as error:
        mja.MultiTableArena([[np.nan, i, 1] for i in range(100)])
    assert str(error.value).endswith("\n- and 70 more")
    assert len(messages.problems_of(error.value)) == 100
    twice = [problem("table_rots", "numbers", None, "a")] * 2
    assert str(messages.error(twice, "a call")) == "`table_rots` must be numbers in a regular array, got 'a'."


def test_problems_travel():
    """In errors and warnings of Python's own kinds; of others, there is the text."""
    one = problem("xml", "no_mjcf", None, "a.xml")
    error = messages.error([one], kind=FileNotFoundError)
    assert (type(error), messages.problems_of(error)) == (FileNotFoundError, (one,))
    assert messages.problems_of(KeyError("x"))[0].numbers["text"] == "'x'"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        messages.warn(problem("table_rots", "degrees", most=90.0))
    assert caught[0].filename == __file__
    assert messages.problems_of(caught[0].message)[0].key == ("table_rots", None, "degrees")


def moved():
    """An arena whose table's slab was edited."""
    one = open_arena()
    one.spec.geom("table0_collision").size = (1, 1, 1)
    return one


def twice():
    """An arena with two terms of one number."""
    one = open_arena()
    one.vary(a=dr.Term("geom.friction", "floor"), b=dr.Term("geom.friction", "floor", axes="sliding"))
    return one


def widening(ranges):
    pytest.importorskip("mjx_arenas.envs").widening(open_arena(), ranges)


CARRIED = {
    "sim": (lambda: open_arena().put_model("cuda"), ("impl", None, "must"), "cuda"),
    "twin": (lambda: open_arena().c_world(host(open_arena()), data=3), ("data", None, "of_type"), "int"),
    "write": (lambda: mja.set_const(0.5), ("model", None, "of_type"), "float"),
    "record": (lambda: moved().record, ("arena.spec", None, "decided"), None),
    "terms": (lambda: twice().record, ("terms", None, "terms_both"), "a"),
    "viz": (lambda: mja.picture_sheet(0, "uv"), ("kind", None, "one_of"), "uv"),
    "pixels": (lambda: memory.check(10**9, memory.Bytes(1e9, 0, 0)), ("batch", None, "room_for_pictures"), 10**9),
    "checks": (lambda: mja.check(open_arena(), mja.ArenaRanges(), worlds=[]), ("worlds", None, "must"), "none"),
    "preflight": (
        lambda: mja.differences(open_arena().put_model("jax"), {}),
        ("compiled", None, "has"),
        "an empty dict",
    ),
    "files": (lambda: mja.load(5), ("path", None, "must"), 5),
    "settings": (lambda: settings.find("lif"), ("task", None, "no_task_meant"), "lif"),
    "varied": (lambda: open_arena().randomization_fn(mja.ArenaRanges()), ("ranges", None, "nothing_varies"), None),
    "envs": (lambda: widening(3), ("arena", None, "arena_and_ranges"), "MultiTableArena and int"),
    "progress": (lambda: mja.check(open_arena(), mja.ArenaRanges(), progress=1), ("progress", None, "must"), 1),
}
"""By folder or module: a call, path, index and rule of the problem that its error carries, and what came."""


@pytest.mark.parametrize("folder", CARRIED)
def test_errors_carry_problems(folder):
    """Those of rules that one folder has, too: where, which rule, and what came."""
    call, key, got = CARRIED[folder]
    with pytest.raises((ValueError, TypeError)) as raised:
        call()
    (one,) = messages.problems_of(raised.value)
    assert one.key == key
    assert one.got == got
    assert str(raised.value) == messages.sentence(one)


def test_problems_get_another_place():
    """Of many worlds, of a part of an argument, of a file: the data changes, and the words follow."""
    (low,) = mja.Uniform(1, 0).problems()
    assert low.key == ("low", None, "ordered")
    (low,) = under("ranges.table_rots", [low], dist="Uniform")
    assert messages.sentence(low) == "`ranges.table_rots` (Uniform): `low` must be <= `high`, got 1 and 0."
    (low,) = in_world([low], 3)
    assert messages.sentence(low).startswith("World 3: `ranges.table_rots` (Uniform): `low` must")
    legs = Problem("arena.has_legs", "truth", got=[None, True], source=Source("a.yaml", 4))
    assert messages.sentence(legs) == "a.yaml:4: `arena.has_legs` must be true or false, got [null, true]."
    assert messages.sentence(legs._replace(source=None)).endswith("got [None, True].")
    placed = Problem(
        "objects.mass",
        "must",
        ("object", "c"),
        -1,
        {"quantity": "object_masses"},
        source=Source("a.yaml", 4, "arena.x"),
    )
    assert messages.sentence(placed) == "a.yaml:4: `arena.x`: Object 'c': `mass` must be > 0 [kg], got -1."


def test_values_are_shown_short():
    for value, text in (
        (np.float64(0.5), "0.5"),
        (np.array([[1, 2]]), "[[1, 2]]"),
        ((1, np.int32(2)), "(1, 2)"),
        ((1,), "(1,)"),
        ("a", "'a'"),
        ([0.0] * 100, f"{str([0.0] * 100)[:100]} ..."),
        (np.zeros(100), f"{str([0.0] * 100)[:100]} ..."),
        (mja.TableArena().put_model("jax"), "Model"),
        (mujoco.MjSpec(), "MjSpec"),
        ([rendered, mujoco.MjSpec()], "[rendered, MjSpec]"),
        ("as it is at 0x1", "'as it is at 0x1'"),
    ):
        assert messages.show(value) == text
