"""The code in docs/training.md, which tests run as it stands."""

import pathlib
import re

TRAINING = (pathlib.Path(__file__).parent.parent / "docs" / "training.md").read_text()


def section(heading):
    """The text under a heading of the second level."""
    return re.search(rf"^## {heading}\n(.*?)(^## |\Z)", TRAINING, flags=re.DOTALL | re.MULTILINE)[1]


def run(block, names):
    """Executes a block in a namespace."""
    exec(compile(block, "docs/training.md", "exec"), names)


def blocks(heading):
    """The Python under it."""
    return re.findall(r"```python\n(.*?)```", section(heading), flags=re.DOTALL)
