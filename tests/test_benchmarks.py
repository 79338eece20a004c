"""The benchmark suite runs: cheap cases at tiny size, for what they compute, not for how fast."""

import importlib
import json
import math
import os
import pathlib
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import worlds

import mjx_arenas as mja
from benchmarks import box_contacts, kitchen
from benchmarks import when_needed as benchmark
from benchmarks.__main__ import merge, run, targets
from benchmarks.case import SIZES, Case
from benchmarks.cases import CASES
from mjx_arenas import settings

pytestmark = pytest.mark.slow

ROOT = pathlib.Path(__file__).parent.parent
CHEAP = ("randomize", "recompile", "dropped", "lines", "warp_alone", "bytes_per_world", "c_mujoco")


def suite(*arguments):
    command = [sys.executable, "-m", "benchmarks", *map(str, arguments)]
    env = {**os.environ, "PYTHONPATH": f"{worlds.CHILDREN}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    return subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """What the cheap cases print and what they write."""
    out = tmp_path_factory.mktemp("results")
    done = suite(*CHEAP, "--size", "tiny", "--json", "--out", out)
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert printed == json.loads((out / "cpu.json").read_text())
    return printed


@pytest.mark.xslow
def test_numbers(results):
    """Every case has its rows, and every number is finite and positive where it is a size or a time."""
    assert set(results) == set(CHEAP)
    for name, result in results.items():
        assert result["rows"], name
        for row in result["rows"]:
            for metric, value in row.items():
                if isinstance(value, float):
                    assert math.isfinite(value), (name, metric)
                    assert value > 0 or metric.startswith("largest_"), (name, metric)


@pytest.mark.xslow
def test_record(results):
    """Every case says where, when, with what and how it was measured."""
    for result in results.values():
        assert {"device", "platform", "cpu", "cores", "python", "commit", "date", "size"} <= result.keys()
        assert result["command"].startswith("mjx-arenas bench randomize")
        assert "unknown" not in {result["versions"][name] for name in ("mujoco", "jax", "numpy")}


def test_comparisons(results):
    """What is compared does the same: mujoco_warp's trajectories; a copy of the bytes that `nbytes` counts."""
    assert results["warp_alone"]["rows"][0]["largest_qpos_difference"] < 1e-4
    model_bytes = results["bytes_per_world"]["rows"][0]["model_bytes"]
    assert results["randomize"]["rows"][0]["bytes_per_world"] > model_bytes
    with_ = [row["with"] for row in results["c_mujoco"]["rows"]]
    assert with_ == ["rollout_recompiled", "c_batch", "batch_shared_model"]


def test_unknown_case():
    """One sentence and exit code 2."""
    done = suite("no_such_case")
    assert done.returncode == 2
    assert done.stderr.startswith("error: There is no case no_such_case; there are most_worlds, randomize, ")


def test_when_needed_values():
    """Each pair of numbers is in effect where its step is traced, and what it adds is against a step that never draws."""
    state = pytest.importorskip("mujoco_playground").State
    module = importlib.import_module("mjx_arenas.envs.when_needed")
    before, traced = (module._PENDING, module._CHUNK), []

    class Env:
        action_size = 1

        def reset(self, key):
            zero = jnp.zeros(())
            return state(None, zero, zero, zero, {}, {"episode": zero, "rng": zero, "ready": zero > 0, "drawn": zero})

        def step(self, state, action):
            drawn = self._prepare(state.info, state.done > 0)[0]
            return state.replace(info=state.info | {"drawn": state.info["drawn"] + drawn})

        def _prepare(self, info, begins):
            traced.append((module._PENDING, module._CHUNK))
            return module.when_needed(lambda x: x + 1.0, begins, begins, info["episode"], info["episode"])[0], 0, 0

    pairs = [(16, 8), (2, 4)]
    rows = list(benchmark.costs(lambda change: change(Env)(), worlds=4, length=4, values=pairs))
    assert list(dict.fromkeys(traced)) == pairs
    assert before == (module._PENDING, module._CHUNK)
    assert [(row["ends"], row["pending"], row["chunk"]) for row in rows] == [
        (ends, *pair) for ends in ("spread", "together") for pair in ((None, None), *pairs)
    ]
    for first in (0, 3):
        for row in rows[first : first + 3]:
            assert row["ms_per_step"] > 0
            assert row["added_ms"] == row["ms_per_step"] - rows[first]["ms_per_step"]


def test_when_needed_scenes(monkeypatch, tmp_path):
    """--scene says what is stepped."""
    made = []

    def costs(make_env, *args):
        make_env(
            lambda kind: lambda **given: made.append((kind.__name__, given.get("config_overrides", {}).get("impl")))
        )
        return iter([])

    monkeypatch.setattr(benchmark, "costs", costs)
    for given in ([], ["--scene", "arm"]):
        assert benchmark.main(["--impl", "jax", *given, "--json", str(tmp_path / "x.json")]) == 0
    assert made == [("Push", "jax"), ("Hold", None)]
    assert json.loads((tmp_path / "x.json").read_text())["scene"] == "arm"


class Broken(Case):
    """Fails after its first row."""

    def function(self):
        def rows():
            yield {"impl": "jax", "seconds": 0.5}
            raise ValueError("no more")

        return rows


def test_error_is_reported(capsys):
    """A case that fails keeps the rows it had and its reason."""
    result = run(Broken("broken", "", "", {"tiny": {}}, by=("impl",)), "tiny")
    assert result["rows"] == [{"impl": "jax", "seconds": 0.5}]
    printed = capsys.readouterr()
    assert printed.out.splitlines() == ["broken.jax.seconds 0.5", "broken.error ValueError: no more"]
    assert "Traceback" in printed.err


def test_skip_is_reported(monkeypatch, capsys):
    """What is compared with and not installed is said, with the reason."""
    monkeypatch.setenv("MJX_ARENAS_ROBOSUITE", "nowhere")
    result = run(next(case for case in CASES if case.name == "robosuite"), "tiny")
    assert result["skipped"].startswith("robosuite is not installed: `make bench-rivals`")
    assert "robosuite.skipped robosuite is not installed" in capsys.readouterr().out


@pytest.mark.skipif(jax.default_backend() == "gpu", reason="there is one")
def test_without_a_gpu(capsys):
    """A case that profiles a GPU's kernels says that there is none."""
    result = run(next(case for case in CASES if case.name == "terms_kernels"), "tiny")
    assert result["rows"] == []
    assert result["skipped"] == "it profiles the kernels of a GPU, and there is none"
    assert f"terms_kernels.skipped {result['skipped']}" in capsys.readouterr().out


def test_kitchen():
    """Its objects stand on all of the surfaces that it names, Transfer's goals among them, and find a place in nearly all worlds."""
    one, ranges = kitchen.arena(), kitchen.ranges()

    def world(key):
        params = one.sample_params(key, ranges)
        return params.object_tables, one.valid(params, ranges) & one.place(params, key).valid.all()

    on, valid = jax.jit(jax.vmap(world))(mja.world_keys(0, range(200)))
    assert {one.surfaces[i] for i in np.unique(on)} == set(kitchen.SURFACES) >= set(kitchen.GOALS)
    assert valid.mean() > 0.98


def test_cases_are_right():
    """Names are unique, functions exist, sizes are known."""
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert callable(case.function())
        assert set(case.sizes) <= set(SIZES)


def test_targets():
    """A target is met or missed, by the metric's name."""
    case = Case("c", "", "", {}, by=("worlds",), targets={"8.share": (">=", 0.4), "*.steps": ("<", 20)})
    rows = [{"worlds": 8, "share": 0.5, "steps": 30.0}, {"worlds": 4, "share": 0.1, "steps": 3.0}]
    assert targets(case, rows) == {"8.share": ">= 0.4: met", "8.steps": "< 20: missed", "4.steps": "< 20: met"}


def test_recorded_targets():
    """What is recorded of the GPU says of each metric whether its target is met, by the targets that cases have now."""
    recorded = json.loads((ROOT / "benchmarks" / "results" / "gpu.json").read_text())
    measured = [case for case in CASES if case.targets and case.name in recorded]
    assert len(measured) > 10
    for case in measured:
        assert recorded[case.name]["targets"] == targets(case, recorded[case.name]["rows"]), case.name


def test_failed_case_leaves_earlier_results(tmp_path):
    """What a case without its package, or one that breaks off, would write does not replace what was measured."""
    path, good = tmp_path / "cpu.json", {"rows": [{"seconds": 1.0}]}
    merge(path, {"kinds": good})
    merge(path, {"kinds": {"rows": [], "error": "Boom"}, "mjlab": {"rows": [], "skipped": "not installed"}})
    assert json.loads(path.read_text()) == {"kinds": good, "mjlab": {"rows": [], "skipped": "not installed"}}
    merge(path, {"kinds": {"rows": []}})
    assert json.loads(path.read_text())["kinds"] == {"rows": []}


def test_box_contacts(tmp_path):
    """A task's arena keeps Warp's own contacts of boxes in one way, and has C's in the other; what has neither is refused."""
    pytest.importorskip("mujoco_playground")
    for task in ("lift", "pick_and_place", "push"):
        config = settings.configuration(
            settings.settled(settings.read(settings.find(task)), False, False), "jax", False
        )
        (tmp_path / task).mkdir()
        (tmp_path / task / "config.json").write_text(json.dumps(config))
    for task in ("lift", "pick_and_place"):
        for way, as_in_c in (("native", False), ("as_in_c", True), ("native", False)):
            flags = box_contacts.environment(tmp_path / task, way).mj_model.opt.disableflags
            assert bool(flags & box_contacts.NATIVE) == as_in_c
    with pytest.raises(ValueError, match=r"push is no training of lift or pick_and_place in their own arenas\.$"):
        box_contacts.environment(tmp_path / "push", "as_in_c")


def test_box_contacts_of_nothing(tmp_path, capsys):
    """A folder that is no training's is answered in a sentence."""
    with pytest.raises(SystemExit):
        box_contacts.main([str(tmp_path), "--json", str(tmp_path / "x.json")])
    assert f"FOLDER must be the folder of a training, got '{tmp_path}'. See" in capsys.readouterr().err
