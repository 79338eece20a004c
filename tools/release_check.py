"""Builds what a release has, installs it into clean environments, and tries it there: `make release-check`."""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv

ROOT = pathlib.Path(__file__).parent.parent
DIST = ROOT / "out" / "dist"
TRIED = {
    "": "import mjx_arenas as mja; mja.TableArena().mj_model",
    "warp": "import warp, mjx_arenas as mja; mja.TableArena().put_model('warp')",
    "viz": "import matplotlib, av, PIL, scipy, rich, mjx_arenas as mja; mja.textures.Wood",
    "cli": "import mjx_arenas as mja; from mjx_arenas import cli; mja.load('kitchen'); cli.main(['stats', 'shelf', '-n', '12'])",
    "train": "import jax, mjx_arenas.envs as envs; env = envs.Push(config_overrides={'impl': 'jax'}); "
    "state = jax.jit(env.reset)(jax.random.key(0)); jax.jit(env.step)(state, jax.numpy.zeros(env.action_size)).reward.item()",
    "cuda": "import jax, warp",
}
"""What must run where the package was installed with one extra alone."""


def main() -> int:
    """Exit code: 0 if all that was tried works."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", action="append", help="to try, such as python3.12; default: this one")
    parser.add_argument("--extra", action="append", choices=[*TRIED], help="to try; default: all but cuda (5 GB)")
    options = parser.parse_args()
    extras = options.extra or [extra for extra in TRIED if extra != "cuda"]
    wheel, sdist = build()
    failed = []
    for python in options.python or [sys.executable]:
        for file in (wheel, sdist):
            failed += [] if tried(python, file, "", readme()) else [f"{file.name}: README's code, {python}"]
        for extra in extras:
            name = f"{wheel.name}[{extra}], {python}"
            failed += [] if tried(python, wheel, extra, TRIED[extra]) else [name]
    print("\n".join(["Failed:", *failed]) if failed else f"All is fine: {wheel.name}, {sdist.name}.")
    return int(bool(failed))


def build() -> tuple[pathlib.Path, pathlib.Path]:
    """The wheel and the sdist, each with what it must have."""
    shutil.rmtree(DIST, ignore_errors=True)
    subprocess.run([sys.executable, "-m", "build", "--outdir", str(DIST), str(ROOT)], check=True)
    (wheel,), (sdist,) = DIST.glob("*.whl"), DIST.glob("*.tar.gz")
    return wheel, sdist


def readme() -> str:
    """Its Python, as it stands."""
    return "\n".join(re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL))


def tried(python: str, file: pathlib.Path, extra: str, code: str) -> bool:
    """Whether the code runs, far from the checkout, where only this was installed."""
    with tempfile.TemporaryDirectory(prefix="mjx_arenas_release_") as folder:
        print(f"\n{file.name} with [{extra}] on {python}", flush=True)
        if python == sys.executable:
            venv.create(f"{folder}/env", with_pip=True)
        else:
            subprocess.run([python, "-m", "venv", f"{folder}/env"], check=True)
        own = f"{folder}/env/bin/python"
        what = f"{file}[{extra}]" if extra else str(file)
        steps = [[own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", what], [own, "-c", code]]
        return all(subprocess.run(step, cwd=folder).returncode == 0 for step in steps)


if __name__ == "__main__":
    known = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    users = {"", *known} - {"bench", "docs", "release", "dev"}
    assert set(TRIED) == users, f"each extra for users must be tried: {users ^ set(TRIED)}"
    sys.exit(main())
