"""Warp is quiet, its notes are kept by world and said once, and where it finds no memory the answer is what to set."""

import ctypes
import functools
import logging
import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from mujoco import mjx

import mjx_arenas as mja
from benchmarks import __main__ as bench
from mjx_arenas import cli, gpu, train
from mjx_arenas.checks import failures, watch_mjx
from mjx_arenas.sim import batch as batch_
from mjx_arenas.sim import rollouts, warp_notes

NO_MEMORY = "UNKNOWN: FFI callback error: RuntimeError: Failed to allocate 188743680 bytes on device 'cuda:0'"
ANSWER = (
    "Warp found no 189 MB on the GPU beside what JAX holds: set XLA_PYTHON_CLIENT_PREALLOCATE=false, or "
    "XLA_PYTHON_CLIENT_MEM_FRACTION=0.5, before JAX starts, or make fewer worlds."
)


def hurry(arena):
    """One iteration, which no contact satisfies: the tolerance is 0."""
    option = arena.spec.option
    option.iterations, option.ls_iterations, option.tolerance = 1, 1, 0


@functools.cache
def three():
    arena = mja.TableArena(objects=[mja.Object(f"box{i}", full_size=0.06, pos=(0.1 * i, 0)) for i in range(3)])
    hurry(arena)
    return arena


def heap():
    """Two worlds with a solver of one iteration: in the first three boxes lie on one another, in the second they are in the air."""
    arena = three()
    batch = arena.batch(arena.put_model("warp"), jax.tree.map(lambda p: jnp.stack([p, p]), arena.nominal_params()))
    place = [[[0, 0, 0.8295 + 0.0595 * i + 0.5 * i * w + 0.5 * w, 1, 0, 0, 0] for i in range(3)] for w in range(2)]
    return batch, jnp.asarray(place, jnp.float32).reshape(2, -1)


def made(**room):
    batch, place = heap()
    return batch, mja.make_data(batch, **room).replace(qpos=place)


def printed(capfd):
    """What C code has printed, too, which keeps it in a buffer of its own."""
    ctypes.CDLL(None).fflush(None)
    return capfd.readouterr().out


@pytest.mark.slow
def test_quiet(capfd):
    """Nothing is printed by rollouts and steps of ours, where Warp prints without them."""
    batch, data = made(max_contacts=2)
    loud = jax.vmap(mjx.step, in_axes=(batch.in_axes, 0))(batch.model, data)
    jax.block_until_ready(loud)
    said = printed(capfd)
    for line in ("solver iterations limit reached", "narrowphase overflow"):
        assert line in said
    jax.block_until_ready(mja.rollout(batch, mja.step(batch, data), 2))
    assert printed(capfd) == ""


@pytest.mark.slow
def test_notes_of_each_world():
    """Limits and drops are kept by world; a later step in which all is well does not hide them."""
    batch, data = made()
    report = mja.capacity(batch, mja.rollout(batch, data, 2))
    np.testing.assert_array_equal(report.solver_limits, [True, False])
    np.testing.assert_array_equal(report.noted["ITERATIONS"] | report.noted["LS_ITERATIONS"], [True, False])
    assert not report.overflowed.any()
    assert not any(report.noted[name].any() for name in report.noted if "ITERATIONS" not in name)
    apart = mja.rollout(batch, data, 2).replace(qpos=jnp.stack([data.qpos[1]] * 2), qvel=jnp.zeros_like(data.qvel))
    later = jax.jit(functools.partial(mja.capacity, batch))(mja.rollout(batch, apart, 2))
    np.testing.assert_array_equal(later.solver_limits, [True, False])
    few = mja.capacity(batch, mja.rollout(*made(max_contacts=2), 2))
    np.testing.assert_array_equal(few.noted["NARROWPHASE"], [True, True])  # Warp has one room for all
    found = str(few)
    assert found.startswith("Of 2 worlds: contacts were dropped in 2, the solver stopped at its limit in ")
    assert "NARROWPHASE in 2" in found
    assert "TACTILE" not in found
    assert found.endswith(f"the last step needs room for at most {int(few.needed)} contacts a world")
    one = jax.vmap(warp_notes.solver_limits)(apart)
    np.testing.assert_array_equal(one, [True, False])


def test_nothing_to_note_on_jax():
    arena = mja.TableArena(objects=[mja.Object("ball", "sphere")])
    batch = arena.randomize(arena.put_model("jax"), jax.random.split(jax.random.key(0), 2), mja.ArenaRanges())
    report = mja.capacity(batch, mja.make_data(batch))
    assert (report.noted, report.solver_limits.tolist()) == ({}, [False, False])
    assert str(report) == (
        "Of 2 worlds: contacts were dropped in 0, the solver stopped at its limit in 0 "
        "(impl='jax' has room for all contacts, and does not report its solver)"
    )


@pytest.mark.slow
def test_said_once(caplog, monkeypatch):
    """One line in the log for each kind, however many rollouts; none of it waits for a result."""
    monkeypatch.setattr(warp_notes, "NOTES", warp_notes.Notes())
    batch, data = made(max_contacts=2)
    with caplog.at_level(logging.INFO, logger="mjx_arenas"):
        for _ in range(3):
            data = jax.block_until_ready(mja.rollout(batch, mja.step(batch, data), 2))
        jax.block_until_ready(warp_notes.NOTES._pending)
        warp_notes.NOTES.tell()
    said = [record.message.split(":")[0] for record in caplog.records]
    assert said == [
        "Warp dropped contacts for want of room",
        "Warp's solver reached the limit of its iterations",
    ]


def test_waits_for_nothing(caplog):
    """What is not there yet is looked at later."""

    class Later:
        ready = False

        def is_ready(self):
            return self.ready

        def __jax_array__(self):
            raise AssertionError("waited for")

        def __int__(self):
            assert self.ready
            return warp_notes._bits("ITERATIONS")

    notes, later = warp_notes.Notes(), Later()
    notes._pending.append(later)
    notes.tell()
    assert len(notes._pending) == 1
    later.ready = True
    notes.tell()
    assert not notes._pending
    assert len(caplog.records) == 1

    class Failed(Later):
        ready = True

        def __int__(self):
            raise jax.errors.JaxRuntimeError(NO_MEMORY)

    notes._pending.append(Failed())
    notes.tell()  # at the end of a program, or in another call: not there
    assert not notes._pending


@pytest.mark.slow
def test_check_says_it(capfd):
    """In its report, once, and not as a failure."""
    arena = mja.TableArena(objects=[mja.Object("box", full_size=0.06)])
    hurry(arena)
    report = mja.check(arena, mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)), 2, n_steps=10, engine="warp")
    assert report.ok
    assert report.solver_limits.all()
    end = "In 2 of 2 worlds the solver stopped at the limit of its iterations (`iterations` and `ls_iterations` of `arena.spec.option`)"
    assert str(report).splitlines()[-1] == f"{end}: forces are less exact there."
    assert report.to_dict()["n_solver_limits"] == 2
    assert printed(capfd) == ""


def _no_memory(*_, **__):
    raise jax.errors.JaxRuntimeError(NO_MEMORY)


@pytest.mark.slow
def test_no_memory(monkeypatch):
    """Each call of ours that steps answers Warp's error; others stay as they are."""
    batch, data = made()
    monkeypatch.setattr(rollouts, "_rollout", _no_memory)
    monkeypatch.setattr(batch_, "_step", _no_memory)
    monkeypatch.setattr(watch_mjx, "roll", _no_memory)
    calls = [
        lambda: mja.rollout(batch, data, 2),
        lambda: mja.step(batch, data),
        lambda: mja.check(three(), mja.ArenaRanges(table_rots=mja.Uniform(-1, 1)), 1, n_steps=1, engine="warp"),
    ]
    for call in calls:
        with pytest.raises(MemoryError) as caught:
            call()
        assert str(caught.value) == ANSWER
        assert isinstance(caught.value.__cause__, jax.errors.JaxRuntimeError)
    graph = "Graph creation error: Warp CUDA error 2: out of memory (in function wp_cuda_graph_create_exec)"
    with pytest.raises(MemoryError, match=r"^Warp found no memory on the GPU beside"), warp_notes.no_room_answered():
        raise RuntimeError(graph)
    others = "RESOURCE_EXHAUSTED: Out of memory allocating 5 bytes.", "Failed to allocate 8 bytes on device 'cpu'"
    for message in others:
        with pytest.raises(RuntimeError, match="allocat"), warp_notes.no_room_answered():
            raise RuntimeError(message)


def test_no_memory_for_commands(tmp_path, monkeypatch, capsys):
    """The command line and the training end with the sentence."""
    monkeypatch.chdir(tmp_path)

    def check(*_, **__):
        with warp_notes.no_room_answered():
            _no_memory()

    monkeypatch.setattr(failures, "check", check)
    assert cli.main(["check", "shelf", "-n", "1"]) == 2
    assert capsys.readouterr().err == f"error: {ANSWER}\n"
    monkeypatch.setattr(train, "train", _no_memory)
    monkeypatch.setattr(jax, "local_device_count", lambda: 1)
    assert cli.main(["train", "push", "--num-envs", "16", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == f"error: {ANSWER}\n"


GIVEN = ("XLA_PYTHON_CLIENT_MEM_FRACTION", "XLA_PYTHON_CLIENT_PREALLOCATE")


@pytest.mark.parametrize(
    ("impl", "there", "given", "expected"),
    [
        ("warp", True, {}, {"XLA_PYTHON_CLIENT_PREALLOCATE": "false"}),
        (None, True, {}, {"XLA_PYTHON_CLIENT_PREALLOCATE": "false"}),
        ("warp", False, {}, {}),
        ("jax", True, {}, {}),
        ("c", True, {}, {}),
        *(("warp", True, {name: "0.8"}, {name: "0.8"}) for name in GIVEN),
    ],
)
def test_leave_room(impl, there, given, expected, monkeypatch):
    """JAX leaves memory to Warp on a GPU, unless somebody has said how much it takes."""
    monkeypatch.setattr(gpu, "has_gpu", lambda: there)
    monkeypatch.setattr(os, "environ", dict(given))
    gpu.leave_room(impl)
    assert os.environ == expected


@pytest.mark.parametrize(
    ("arguments", "leaves"),
    [
        (["check", "shelf"], True),
        (["check", "shelf", "--engine", "c"], False),
        (["render", "shelf", "-n", "1", "-o", "a.mp4"], True),
        (["render", "shelf", "-n", "1", "-o", "a.png"], False),
        (["demo"], True),
        (["demo", "--impl", "jax"], False),
        (["warmup", "shelf"], True),
        (["warmup", "shelf", "--engine", "jax"], False),
        (["train", "push"], True),
        (["train", "push", "--impl", "jax"], False),
    ],
)
def test_commands_leave_room(arguments, leaves, tmp_path, monkeypatch):
    """Those that step on Warp do so, before the file is loaded, or JAX has started."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(gpu, "has_gpu", lambda: True)
    monkeypatch.setattr(os, "environ", {})
    for function in ("mjx_arenas.files.load.load", "mjx_arenas.demo.Demo", "mjx_arenas.train.before"):
        monkeypatch.setattr(function, _stop)
    cli.main(arguments)
    assert (os.environ.get("XLA_PYTHON_CLIENT_PREALLOCATE") == "false") == leaves


def test_benchmarks_leave_room(monkeypatch):
    """Before they ask JAX for the device."""
    monkeypatch.setattr(gpu, "has_gpu", lambda: True)
    monkeypatch.setattr(os, "environ", {})
    monkeypatch.setattr("benchmarks.measure.environment", _stop)
    with pytest.raises(ValueError, match="far enough"):
        bench.main(["lines"])
    assert os.environ["XLA_PYTHON_CLIENT_PREALLOCATE"] == "false"


def _stop(*_, **__):
    raise ValueError("far enough")
