"""Draws docs/site.png: two pages of the site in Chromium, one light and one dark. `make docs` comes first."""

import functools
import http.server
import pathlib
import subprocess
import tempfile
import threading

from PIL import Image

ROOT = pathlib.Path(__file__).parent.parent
SIZE = (1000, 800)
QUIET = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--hide-scrollbars"]
DARK = ["--force-dark-mode", "--blink-settings=preferredColorScheme=0"]


class Silent(http.server.SimpleHTTPRequestHandler):
    """Serves a folder without a line for each request."""

    def log_message(self, *args: object) -> None:
        """Nothing is printed."""


def shot(url: str, flags: list[str], folder: pathlib.Path) -> Image.Image:
    """A page as Chromium shows it."""
    file = folder / "page.png"
    window = f"--window-size={SIZE[0]},{SIZE[1]}"
    own = [f"--user-data-dir={folder / str(len(flags))}", f"--screenshot={file}"]
    subprocess.run(["chromium", *QUIET, *flags, window, *own, url], check=True, capture_output=True)
    return Image.open(file).convert("RGB").resize((700, 560), Image.Resampling.LANCZOS)


def main() -> None:
    """Two pages side by side."""
    handler = functools.partial(Silent, directory=str(ROOT / "out" / "site"))
    with http.server.ThreadingHTTPServer(("localhost", 0), handler) as server, tempfile.TemporaryDirectory() as folder:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        site = f"http://localhost:{server.server_port}/"
        pages = [shot(site, [], pathlib.Path(folder)), shot(f"{site}furniture/", DARK, pathlib.Path(folder))]
        server.shutdown()
    both = Image.new("RGB", (1410, 560), "white")
    for i, page in enumerate(pages):
        both.paste(page, (710 * i, 0))
    both.quantize(128).save(ROOT / "docs" / "site.png", optimize=True)


if __name__ == "__main__":
    main()
