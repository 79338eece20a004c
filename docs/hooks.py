"""What MkDocs does beside building docs: pages from elsewhere in the repository, links that leave docs, and the help of commands."""

import os
import pathlib
import posixpath
import re
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

from mkdocs.plugins import event_priority
from mkdocs.structure.files import File, Files

ROOT = pathlib.Path(__file__).parent.parent
PAGES = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "benchmarks/README.md": "benchmarks.md",
}
"""Pages outside of docs, and where they stand in the site."""
FILM = re.compile(r"\[!\[(?P<text>[^\[\]]*)\]\((?P<picture>[^()#:\s]+)\)\]\((?P<film>[^()#:\s]+\.mp4)\)")
LINK = re.compile(r"\[(?P<text>[^\[\]]*)\]\((?P<to>[^()#:\s]+)(?P<at>#[^()\s]*)?\)")
UNFILLED = re.compile(r"^Read as a file, .*\n\n", re.MULTILINE)  # what pages of the reference say of themselves

HELP = re.compile(r"^`mjx-arenas (?P<words>(?:\w+ )?--help)`$", re.MULTILINE)
COMMAND_LINE = "from mjx_arenas import cli; cli.run()"


def site_path(path: str) -> str:
    """Where a file of the repository stands in the site."""
    if path in PAGES:
        return PAGES[path]
    if path.startswith("notebooks/"):
        return path
    return path.removeprefix("docs/") if path.startswith("docs/") else f"files/{path}"


@event_priority(100)  # before mkdocs-jupyter looks for notebooks
def on_files(files: Files, config: Any) -> Files:
    """Adds the pages from outside, notebooks, and all files that pages link to."""
    for path, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / path).read_text()))
    for notebook in sorted((ROOT / "notebooks").glob("*.ipynb")):
        files.append(File(f"notebooks/{notebook.name}", str(ROOT), config.site_dir, config.use_directory_urls))
    for file in list(files.documentation_pages()):
        if file.src_uri.endswith(".md"):
            for path in linked(file.content_string, repository_path(file.src_uri)):
                if (ROOT / path).is_file() and site_path(path) not in files.src_uris:
                    files.append(File.generated(config, site_path(path), abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Any, files: Files, **_: Any) -> str:
    """Links lead to where files stand in the site; those to folders of code become text. Help of commands becomes what they print.

    What pages of the reference say of being read as files is left out.
    """
    here, stands = repository_path(page.file.src_uri), posixpath.dirname(page.file.src_uri)

    def moved(link: re.Match) -> str:
        path = target(link["to"], here)
        if (ROOT / path).is_dir():
            return link["text"]
        if not (ROOT / path).is_file() or site_path(path) not in files.src_uris:
            return link[0]
        return f"[{link['text']}]({posixpath.relpath(site_path(path), stands or '.')}{link['at'] or ''})"

    def played(film: re.Match) -> str:
        shown = {
            name: posixpath.relpath(posixpath.join(stands, film[name]), page.file.url) for name in ("film", "picture")
        }
        source = f'src="{shown["film"]}" poster="{shown["picture"]}"'
        return f'<video controls muted loop playsinline preload="none" {source} aria-label="{film["text"]}"></video>'

    return HELP.sub(printed, LINK.sub(moved, FILM.sub(played, UNFILLED.sub("", markdown))))


def printed(help_: re.Match) -> str:
    """The help that a command prints, as a block."""
    words = [sys.executable, "-c", COMMAND_LINE, *help_["words"].split()]
    shown = subprocess.run(
        words, cwd=ROOT, env={**os.environ, "COLUMNS": "100"}, capture_output=True, text=True, check=True
    )
    return f"```text\n{shown.stdout}```"


def repository_path(page: str) -> str:
    """The file that a page of the site is made of."""
    return next((path for path, name in PAGES.items() if name == page), f"docs/{page}")


def target(link: str, path: str) -> str:
    """What a link in a file of the repository leads to."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(path), link))


def linked(text: str, path: str) -> Iterator[str]:
    """The files that a text links to."""
    for link in LINK.finditer(text):
        yield target(link["to"], path)
