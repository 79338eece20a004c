"""The code of the pages about training, which tests run as it stands."""

import pathlib
import re

DOCS = pathlib.Path(__file__).parent.parent / "docs"
TRAINING = "\n".join((DOCS / page).read_text() for page in ("training.md", "policies.md"))
TASK = (DOCS / "how_to" / "own_task.md").read_text()


def section(heading):
    """The text under a heading of the second level."""
    return re.search(rf"^## {heading}\n(.*?)(^## |\Z)", TRAINING, flags=re.DOTALL | re.MULTILINE)[1]


def run(block, names):
    """Executes a block in a namespace."""
    exec(compile(block, "docs", "exec"), names)


def blocks(heading):
    """The Python under it."""
    return code(section(heading))


def code(text):
    """The Python of a text."""
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
