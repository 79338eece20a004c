"""Files, folders and the command itself, for the tests of the command line."""

import functools
import os
import shutil
import sys
import textwrap

import pytest

import mjx_arenas as mja
from mjx_arenas import cli
from mjx_arenas.cli import scenes as cli_scenes

SMALL = """
arena:
  type: MultiTableArena
  table_offsets: [[0, 0, 0.8], [1.2, 0, 0.8]]
  objects: [cube]
ranges:
  table_offsets: {Uniform: {low: [0, 0, -0.1], high: [0, 0, 0.1], relative: add}}
  table_rots: {Uniform: [-3, 3]}
  table_active: {Bernoulli: [1, 0.5]}
  object_tables: {Choice: [0, 1]}
"""
TIGHT = """
arena:
  type: TableArena
  objects: [{name: cube, full_size: 0.5}]
ranges:
  table_full_sizes: {Uniform: [[0.4, 0.4, 0.03], [0.8, 0.8, 0.05]]}
  table_active: {Bernoulli: 0.7}
"""


def command():
    """What a user types: the installed entry point, or the module where the package is not installed anew."""
    script = shutil.which("mjx-arenas", path=os.path.dirname(sys.executable))
    return [script] if script else [sys.executable, "-m", "mjx_arenas"]


def write(folder, text, name="arena.yaml"):
    """A file in a folder."""
    file = folder / name
    file.write_text(textwrap.dedent(text))
    return file


def train_main(*arguments, task="push"):
    """The exit code of the command."""
    return cli.main(["train", task, *map(str, arguments)])


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder to work in, with a file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.yaml").write_text(SMALL)
    return tmp_path


@pytest.fixture
def scenes(monkeypatch):
    """Commands load a file that was loaded before in no time: what is compiled for its arena is kept."""
    monkeypatch.setattr(cli_scenes, "load", _load_once)


@functools.cache
def _load_once(file, n_steps=0):
    return mja.load(file)
