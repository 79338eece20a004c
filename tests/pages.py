"""The pages of the documentation, and what stands in them."""

import functools
import pathlib
import posixpath
import re

ROOT = pathlib.Path(__file__).parent.parent
PAGES = sorted(
    str(path.relative_to(ROOT))
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "benchmarks" / "README.md"]
)
BLOCK = re.compile(r"^```(?P<kind>\w+)(?: title=\"(?P<title>[^\"]*)\")?\n(?P<code>.*?)^```$", re.DOTALL | re.MULTILINE)
TABLE = re.compile(r"^\|.*\n\|[-:| ]+\|\n(?:\|.*\n)*", re.MULTILINE)
LINK = re.compile(r"\]\(([^()\s]+)\)")


@functools.cache
def text(page):
    return (ROOT / page).read_text()


def blocks(page, kind="python"):
    """The code of a page, and the titles of its blocks."""
    return [(found["code"], found["title"] or "") for found in BLOCK.finditer(text(page)) if found["kind"] == kind]


def prose(page):
    """A page without its blocks."""
    return BLOCK.sub("", text(page))


def tables(page):
    """The tables of a page, line by line."""
    return TABLE.findall(prose(page) + "\n")


def links(page):
    """(path in the repository, anchor) of each link that stays in it."""
    for link in LINK.findall(prose(page)):
        path, _, anchor = link.partition("#")
        if "://" not in path:
            yield posixpath.normpath(posixpath.join(posixpath.dirname(page), path)) if path else page, anchor


@functools.cache
def anchors(page):
    """Of its headings, as forges and the site make them."""
    found, seen = set(), {}
    for heading in re.findall(r"^#+ (.*)$", prose(page), flags=re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")
        seen[slug] = seen.get(slug, -1) + 1
        found.add(f"{slug}-{seen[slug]}" if seen[slug] else slug)
    return found


def commands(page):
    """What the page tells to type."""
    lines = [line for code, _ in blocks(page, "sh") for line in code.splitlines()]
    typed = [line.partition("  #")[0].strip() for line in lines if line.strip() and not line.startswith("#")]
    return [line.partition(" # ")[0] for line in typed]


def named_commands(page):
    """The same within sentences, often without all that they need."""
    return re.findall(r"`((?:mjx-arenas|make|python) [^`]+)`", prose(page))
