"""docs/terms.md: its code runs, and its table has every attribute with its numbers and fields."""

import pathlib
import re

import mujoco
import oracle
import pytest
from models import ARMS, MJX, SUITE
from mujoco import mjx
from test_stepped import LOOPS, OTHERWISE, ROUNDED

import mjx_arenas as mja
from mjx_arenas import dr
from mjx_arenas.named import RATIO, WEIGHT
from mjx_arenas.preflight.leaves import named_leaves
from mjx_arenas.spec.comparing import NOT_READ
from mjx_arenas.terms.attributes import KINDS
from mjx_arenas.terms.attributes.attribute import only_on_warp
from mjx_arenas.terms.attributes.fixed import FIXED, ROWS
from mjx_arenas.terms.attributes.geoms import never_read
from mjx_arenas.write.scene import INERTIAL

DOCS = pathlib.Path(__file__).parent.parent / "docs"
TEXT = (DOCS / "terms.md").read_text()


def numbers(quantity):
    """As the table says them."""
    if quantity.kind is bool:
        return "true or false"
    axes = quantity.axes.split(", ")
    said = f"{len(axes)} numbers" if quantity.axes[:1].isdigit() else quantity.axes or "one"
    return f"{said} {quantity.unit}".strip()


def fields(attribute):
    """The same; what geoms weigh is in the inertials of their bodies."""
    named = [t.field.replace("data.turn", "data.qpos") for t in attribute.targets if t.field != RATIO]
    return ", ".join(f"`{name}`" for name in dict.fromkeys(INERTIAL if WEIGHT in named else named))


@pytest.mark.slow
def test_code():
    """The example runs as it stands."""
    (block,) = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    exec(compile(block, "docs/terms.md", "exec"), {})


def test_table():
    """One row an attribute, in the order of `dr.ATTRIBUTES`."""
    rows = [row.strip("|").split(" | ") for row in re.findall(r"^\| `\w+\.\w+` \|.*$", TEXT, flags=re.MULTILINE)]
    rows = [row for row in rows if len(row) == 9]
    on_jax = {
        name: "no" if a.unseen_on_jax in (only_on_warp, never_read) else "partly" if a.unseen_on_jax else "yes"
        for name, a in dr.ATTRIBUTES.items()
    }
    assert [row[4:7] for row in rows] == [[on_jax[name], "yes", "yes"] for name in dr.ATTRIBUTES]
    assert [(row[0].strip(" `"), row[1], row[2]) for row in rows] == [
        (name, numbers(a.quantity), fields(a)) for name, a in dr.ATTRIBUTES.items()
    ]
    for page in ("README.md", "docs/ranges.md"):
        assert f"{len(rows)} attributes" in (DOCS.parent / page).read_text()


def test_steps():
    """The table of what is stepped has each model once, and says where C's steps are not the reference."""
    table = TEXT.partition("| models | leaves")[2].partition("\n\n")[0]
    rows = [row.strip("| ").split(" | ") for row in table.splitlines()[2:-1]]
    every = (*SUITE, *MJX, *ARMS)
    named = {name: row for row in rows for name in re.findall(r"\w+", re.sub(r"\(.*?\)", "", row[0])) if name in every}
    assert sorted(named) == sorted(every)
    assert sum(len(re.findall(rf"\b{name}\b", table)) for name in every) == len(every)
    for name, (_, leaves, on_jax, on_warp) in named.items():
        loops = "C while open, MJX while closed" if name in LOOPS else "C"
        assert (leaves, on_warp) == ("equal", loops), name
        rounded = "C, as near as MJX's own steps" if name in ROUNDED else loops
        assert on_jax == ("MJX" if name in OTHERWISE else rounded), name


def test_what_does_not():
    """The table of what is the same in all worlds is that of `fixed.ROWS`, and none of it varies by another name."""
    rows = re.findall(
        r"^\| ((?:`\w+\.[\w*]+`(?:, )?)+) \| (.*?) \| (.*?) \|$",
        TEXT.partition("whatever the elements:")[2],
        re.MULTILINE,
    )
    assert rows == [(", ".join(f"`{name}`" for name in row.names), row.why, row.instead) for row in ROWS]
    assert len(FIXED) == sum(len(row.names) for row in ROWS)
    assert not FIXED.keys() & dr.ATTRIBUTES.keys()
    for name in re.findall(r"`(\w+\.\w+)`", " ".join(row.instead for row in ROWS)):
        assert name in dr.ATTRIBUTES, name


LITTLE = """<mujoco><asset><texture name="t" type="2d" builtin="flat" width="4" height="4"/><material name="m" texture="t"/>
<mesh name="mesh" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody><camera/><light/><site/>
<body name="b"><joint name="j"/><geom name="g" type="mesh" mesh="mesh"/></body></worldbody></mujoco>"""


HAS = {
    "hfield.data": "which Warp shares all the same, and the compiler stretches",
    **{f"{kind}.quat": "which varies by another name" for kind in ("body", "geom", "site", "camera")},
    **{name: "how a step solves a world" for name in FIXED if name.endswith("tolerance")},
    **{name: "for contacts of all worlds" for name in FIXED if name.startswith("option.o_")},
    **{name: "which put_model refuses" for name in FIXED if name.endswith((".delay", ".interval"))},
}
"""What MJX has as arrays that might be of many worlds, though it is fixed."""


def test_fixed_is_shared(impl):
    """MJX has nothing else of it as an array that may be of many worlds."""
    model = mujoco.MjModel.from_xml_string(LITTLE)
    leaves = {
        name.removeprefix("_impl.").replace("opt._impl.", "opt.")
        for name in named_leaves(mjx.put_model(model, impl=impl))
    }
    prefix = {kind: one.prefix + "_" for kind, one in KINDS.items()} | {"option": "opt.", "texture": "tex_"}
    fields = {name: prefix.get(kind, f"{kind}_") + rest for name in FIXED for kind, _, rest in [name.partition(".")]}
    assert {name for name, field in fields.items() if field in leaves} <= HAS.keys()
    assert sum(hasattr(model, field) or hasattr(model.opt, field[4:]) for field in fields.values()) > 35


@pytest.mark.parametrize("name", ["geom.contype", "hfield.data", "option.integrator", "body.quat", "actuator.delay"])
def test_fixed_is_told(name):
    arena, row = mja.Arena.from_xml(LITTLE), FIXED[name]
    with pytest.raises(ValueError, match="cannot vary") as raised:
        arena.vary(x=dr.Term(name, "g"))
    assert str(raised.value) == f"`x.attribute`: {name!r} cannot vary, as {row.why}: {row.instead}."


def test_what_stays():
    """docs/exactness.md names the fields that the oracle and the proof leave out."""
    table = (DOCS / "exactness.md").read_text().partition("## What stays as compiled")[2]
    told = [name for row in re.findall(r"^\| (`.*?) \|", table, re.MULTILINE) for name in re.findall(r"`(\w+)`", row)]
    assert len(told) == len(set(told))
    assert set(told) == {name.removeprefix("_impl.") for name in oracle.STRUCTURE_MAY_DIFFER} | NOT_READ
