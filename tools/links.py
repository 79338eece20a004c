"""Asks every link of the documentation that leaves the repository once whether its page is there: `make links`."""

import concurrent.futures
import pathlib
import re
import sys
import urllib.error
import urllib.request
from collections.abc import Callable

ROOT = pathlib.Path(__file__).parent.parent
FOLDERS = {"": "*.md", "docs": "**/*.md", "benchmarks": "*.md", "notebooks": "*.ipynb", "mjx_arenas": "**/*.py"}
URL = re.compile(r"https?://[^\s<>()\[\]\"'`\\{}]+")
GONE = (404, 410)
TIMEOUT = 20.0  # [s]


def links() -> dict[str, list[str]]:
    """The files in which each address stands."""
    found: dict[str, list[str]] = {}
    for folder, pattern in FOLDERS.items():
        for file in sorted((ROOT / folder).glob(pattern)):
            for url in dict.fromkeys(URL.findall(file.read_text(encoding="utf-8"))):
                found.setdefault(url.rstrip(".,;:"), []).append(str(file.relative_to(ROOT)))
    return found


def answer(url: str) -> int | None:
    """The status of a page; None where nothing answers."""
    request = urllib.request.Request(url, headers={"User-Agent": "Mozilla/5.0 (links of a documentation)"})
    try:
        with urllib.request.urlopen(request, timeout=TIMEOUT) as page:
            return page.status
    except urllib.error.HTTPError as error:  # some sites answer programs with 403 or 429: the page may be there
        return error.code
    except OSError:
        return None


def main(ask: Callable[[str], int | None] = answer) -> int:
    """Exit code: 0 if all pages are there, 1 if one is not, 2 if nothing answers at all."""
    files = links()
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        answers = dict(zip(files, pool.map(ask, files), strict=True))
    if not any(answers.values()):
        print("No link answers: is there a network?")
        return 2
    missing = {url: status for url, status in answers.items() if status is None or status in GONE}
    for url, status in missing.items():
        print(f"{url}: {status or 'no answer'}, in {', '.join(files[url])}")
    print(f"{len(missing)} of {len(files)} links lead nowhere.")
    return int(bool(missing))


if __name__ == "__main__":
    sys.exit(main())
