"""Warp's kernels are found without a launch, and programs are kept: what a first step needs is compiled side by side, before it runs."""

import os
import subprocess
import sys
import threading

import jax
import numpy as np
import pytest
import warp as wp

import mjx_arenas as mja
from mjx_arenas import caches
from mjx_arenas.sim import kernels, launched

SCENE = """<mujoco><option cone="elliptic"/><worldbody><geom type="plane" size="2 2 .1"/>
<body name="desk" pos="0 0 .5"><geom type="box" size=".3 .3 .02"/></body>
<body name="arm" pos="0 -.5 .5"><joint name="hinge" axis="0 1 0" range="-1 1" damping="1"/>
<geom type="capsule" size=".02" fromto="0 0 0 0 0 .2"/><site name="tip" pos="0 0 .2"/></body></worldbody>
<actuator><position joint="hinge" kp="10"/></actuator><sensor><framepos objtype="site" objname="tip"/></sensor></mujoco>"""
MORE = {"mujoco.mjx.warp.ffi"}  # a module without a kernel that a step launches


@pytest.fixture(scope="module")
def worlds():
    arena = mja.Arena.from_xml(SCENE, tables=["desk"])
    arena.add_object(mja.Object("box", full_size=0.05))
    arena.add_object(mja.Object("can", "cylinder", (0.05, 0.05, 0.1)))
    ranges = mja.ArenaRanges(table_full_sizes=mja.Uniform(0.9, 1.1, relative="scale"))
    keys = mja.world_keys(0, range(3))
    batch = arena.randomize(arena.put_model("warp"), keys, ranges)
    return arena, batch, mja.make_data(batch, keys)


def found_in(mj_model, data, fields):
    sizes = launched.Sizes(len(data.qpos), int(data._impl.naconmax), int(data._impl.njmax))
    return launched.of_step(mj_model, sizes, [name.rpartition(".")[2] for name in fields], wp.get_device("cpu"))


@pytest.mark.xslow
@pytest.mark.slow
def test_all_kernels_are_found(worlds, monkeypatch):
    """A step launches the kernels that one found which was only written down, and all of them were loaded when it began."""
    _, batch, data = worlds
    found, before, ran, untouched = {}, kernels.compile_side_by_side, set(), wp.launch

    def compiled(mj_model, data, fields):
        before(mj_model, data, fields)
        needed = found_in(mj_model, data, fields)
        found.update({module: len(module.execs) for module, _ in needed})

    def noted(launch):
        def run(kernel, *args, **kwargs):
            ran.update([kernel.module] if np.prod(kwargs["dim"]) else [])
            return launch(kernel, *args, **kwargs)

        return run

    monkeypatch.setattr(kernels, "compile_side_by_side", compiled)
    monkeypatch.setattr(wp, "launch", noted(wp.launch))
    monkeypatch.setattr(wp, "launch_tiled", noted(wp.launch_tiled))
    jax.block_until_ready(mja.step(batch, data).qpos)
    monkeypatch.undo()
    assert wp.launch is untouched
    assert len(ran) > 20
    assert sorted(m.name for m in ran - found.keys()) == []
    assert {module.name for module in found.keys() - ran} <= MORE
    assert all(found.values())
    assert all(len(module.execs) == n for module, n in found.items())


@wp.kernel
def count(x: wp.array(dtype=int)):
    wp.atomic_add(x, 0, 1)


@wp.kernel(module="unique", module_options={"block_dim": 64})
def in_blocks_of_64(x: wp.array(dtype=int)):
    wp.atomic_add(x, 0, 1)


@pytest.mark.slow
def test_sizes_of_blocks(worlds, monkeypatch):
    """On a GPU a module is compiled for the sizes with which it is launched, or asked about: a size more costs half a minute."""
    arena, batch, data = worlds
    from mujoco.mjx.third_party import mujoco_warp

    def launches(*_):
        for kernel in (count, in_blocks_of_64):
            wp.get_suggested_block_size(kernel)
        wp.launch(in_blocks_of_64, dim=1, inputs=[None], block_dim=64)
        wp.launch(count, dim=1, inputs=[None], block_dim=32)
        wp.launch(count, dim=0, inputs=[None], block_dim=128)

    monkeypatch.setattr(mujoco_warp, "step", launches)
    monkeypatch.setattr(type(wp.get_device("cpu")), "is_cpu", False)
    found = found_in(arena.mj_model, data, batch.fields)
    monkeypatch.undo()
    own = [(module, size) for module, size in found if module in (count.module, in_blocks_of_64.module)]
    assert own == sorted(
        [(count.module, 32), (count.module, 256), (in_blocks_of_64.module, 64)], key=lambda one: (one[0].name, one[1])
    )


@pytest.mark.slow
def test_other_threads_launch(worlds, monkeypatch):
    """What XLA's threads launch while a step is only written down is launched: a step that was begun before is not lost."""
    arena, batch, data = worlds
    from mujoco.mjx.third_party import mujoco_warp

    counted = wp.zeros(1, dtype=int, device="cpu")

    def launches(*_):
        wp.launch(count, dim=1, inputs=[counted])
        assert not counted.numpy()
        thread = threading.Thread(target=lambda: wp.launch(count, dim=3, inputs=[counted], device="cpu"))
        thread.start()
        thread.join()

    monkeypatch.setattr(mujoco_warp, "step", launches)
    needed = found_in(arena.mj_model, data, batch.fields)
    assert count.module in [module for module, _ in needed]
    assert counted.numpy() == 3


def test_what_cannot_be_found_is_left_to_warp(worlds, monkeypatch, caplog):
    """Where Warp is another one, the step compiles its kernels by itself, and a line in the log says so."""
    arena, batch, data = worlds

    def fail(*_):
        raise AttributeError("no such thing")

    monkeypatch.setattr(launched, "of_step", fail)
    with caplog.at_level("DEBUG", logger="mjx_arenas"):
        kernels.compile_side_by_side(arena.mj_model, data, batch.fields)
    assert "kernels are not compiled side by side: AttributeError: no such thing" in caplog.text


APART = """
import pathlib, sys
import mujoco, warp as wp
from mjx_arenas.sim import kernels_apart, launched
wp.init()
model, sizes, on = mujoco.MjModel.from_xml_path(sys.argv[1]), launched.Sizes(2, 20, 90), wp.get_device("cpu")
def built(): return sorted(file.parent.name for file in pathlib.Path(wp.config.kernel_cache_dir).rglob("*.o"))
assert not built()
needed = launched.of_step(model, sizes, [], on)
kernels_apart.compile_together(model, sizes, [], on, needed, 3)
before, times = built(), [file.stat().st_mtime_ns for file in pathlib.Path(wp.config.kernel_cache_dir).rglob("*.o")]
for one in needed:
    launched.load(*one, on)
assert built() == before and len(before) == len(needed) > 20
assert times == [file.stat().st_mtime_ns for file in pathlib.Path(wp.config.kernel_cache_dir).rglob("*.o")]
"""


@pytest.mark.xslow
def test_compiled_apart(tmp_path):
    """What processes of their own compile is all that a step needs, and nothing is compiled twice."""
    (tmp_path / "scene.xml").write_text(SCENE)
    env = {**os.environ, "WARP_CACHE_PATH": str(tmp_path / "cache"), "JAX_PLATFORMS": "cpu"}
    subprocess.run([sys.executable, "-c", APART, tmp_path / "scene.xml"], env=env, check=True)


def test_caches(tmp_path):
    """JAX keeps its programs where the command line has it keep them; what is set stays."""
    code = "from mjx_arenas import caches; caches.keep(); import jax; print(jax.config.jax_compilation_cache_dir)"
    env = {name: value for name, value in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    env["XDG_CACHE_HOME"] = str(tmp_path)
    run = [sys.executable, "-c", code]
    assert subprocess.check_output(run, env=env, text=True).strip() == str(tmp_path / "mjx_arenas" / "xla")
    env["JAX_COMPILATION_CACHE_DIR"] = "/elsewhere"
    assert subprocess.check_output(run, env=env, text=True).strip() == "/elsewhere"


AT_EXIT = """
import atexit
import sys

def told():
    import warp
    warp.config.quiet = True
    warp.init()
    print("cached:", warp.config.cache_kernels, warp.config.kernel_cache_dir)

atexit.register(told)
"""


@pytest.mark.slow
def test_commands_keep_what_they_compile(tmp_path):
    """A process of the command line finds the caches of XLA and Warp on, in their default places, and fills that of XLA."""
    (tmp_path / "sitecustomize.py").write_text(AT_EXIT)
    (tmp_path / "one.yaml").write_text(
        "arena: {type: TableArena}\nranges: {table_rots: {Uniform: [-1, 1]}}\n", encoding="utf-8"
    )
    env = {name: x for name, x in os.environ.items() if name not in ("JAX_COMPILATION_CACHE_DIR", "WARP_CACHE_PATH")}
    paths = [str(tmp_path), *filter(None, [env.get("PYTHONPATH")])]
    env |= {"XDG_CACHE_HOME": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(paths)}
    env |= {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0", "JAX_PLATFORMS": "cpu"}
    words = [sys.executable, "-m", "mjx_arenas", "sample", "one.yaml", "-n", "1", "-o", "one.npz"]
    said = subprocess.run(words, env=env, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert any((tmp_path / "cache" / "mjx_arenas" / "xla").iterdir())
    assert f"cached: True {tmp_path / 'cache' / 'warp'}" in said


def test_folder(monkeypatch):
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", "/home/someone")
    assert str(caches.folder()) == "/home/someone/.cache/mjx_arenas/xla"
