"""docs/terms.md: its code runs, and its table has every attribute with its numbers and fields."""

import pathlib
import re

from mjx_arenas import dr
from mjx_arenas.named import WEIGHT
from mjx_arenas.terms.attributes.attribute import only_on_warp
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
    named = [t.field.replace("data.turn", "data.qpos") for t in attribute.targets]
    return ", ".join(f"`{name}`" for name in dict.fromkeys(INERTIAL if WEIGHT in named else named))


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
