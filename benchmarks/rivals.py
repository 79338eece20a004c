"""What else one could do: compile each world, rebuild it in robosuite, randomize with mjlab, step with C or Warp alone."""

import functools
import json
import os
import pathlib
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import jax
import mujoco
import numpy as np
from mujoco import mjx, rollout

import mjx_arenas as mja
from benchmarks import measure, scene, terms, writing
from mjx_arenas import dr

MAX_DIFFERENCE = 1e-3  # [m] between two trajectories of one world


def recompile(impl: str, worlds: Sequence[int], recompiled: int) -> Iterator[dict[str, Any]]:
    """A fresh MjSpec of each world, and MuJoCo's compiler; one core."""
    arena = scene.arena()
    params = jax.vmap(lambda key: arena.sample_params(key, scene.ranges()))(scene.keys(recompiled))
    each = [jax.tree.map(lambda x, i=i: x[i], jax.tree.map(np.asarray, params)) for i in range(recompiled)]
    theirs, ours = _fresh_model(each[0]), arena.compile(each[0])
    for t in range(arena.n_tables):
        for name in ("size", "friction"):
            a, b = (getattr(m.geom(f"table{t}_collision"), name) for m in (theirs, ours))
            np.testing.assert_allclose(a, b, atol=1e-6)
        np.testing.assert_allclose(theirs.body(f"table{t}").pos, ours.body(f"table{t}").pos, atol=1e-6)
    rate = recompiled / measure.interleaved({"recompile": lambda: [_fresh_model(p).nq for p in each]})["recompile"]
    best = writing.arenas_per_second(impl, worlds)
    yield {"recompiled_per_second": rate, "arenas_per_second": best, "times_recompiling": best / rate}


def _fresh_model(params: mja.ArenaParams) -> mujoco.MjModel:
    """The scene as one would write it without this library: no lights, cameras or materials."""
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    spec = mujoco.MjSpec()
    world = spec.worldbody
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(3, 3, 0.125))
    for t, (offset, yaw, full_size) in enumerate(zip(*params[:3], strict=True)):
        half = full_size / 2
        pos, quat = offset - half * [0, 0, 1], (np.cos(yaw / 2), 0, 0, np.sin(yaw / 2))
        body = world.add_body(name=f"table{t}", pos=pos, quat=quat)
        body.add_geom(name=f"table{t}_collision", type=box, size=half, friction=params.table_frictions[t], priority=1)
        body.add_geom(type=box, size=half, contype=0, conaffinity=0, group=1)
        body.add_site(name=f"table{t}_top", pos=half * [0, 0, 1])
        length = pos[2] / 2
        x, y = np.where(half[:2] > 0.2, half[:2] - 0.1, 0)
        for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)) if params.has_legs[t] else ():
            leg = {"pos": (sx * x, sy * y, -length), "size": (0.025, length, 0), "contype": 0, "conaffinity": 0}
            body.add_geom(type=cylinder, **leg)
        cube = world.add_body(name=f"cube{t}", pos=offset + np.array([0, 0, 0.025]))
        cube.add_freejoint()
        cube.add_geom(type=box, size=(0.025,) * 3)
    return spec.compile()


def robosuite(impl: str, worlds: Sequence[int], rebuilt: int) -> Iterator[dict[str, Any]]:
    """Robosuite's MultiTableArena with 3 tables, its textures included, rebuilt and compiled; one core."""
    theirs = _elsewhere("robosuite", "robosuite_rebuild.py", rebuilt)
    best = writing.arenas_per_second(impl, worlds)
    yield {**theirs, "arenas_per_second": best, "times_robosuite": best / theirs["rebuilt_per_second"]}


def mjlab(impl: str, worlds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Mjlab's `dr` on the same tables: pose, size and friction, without legs or statistics."""
    for n in worlds:
        theirs = _elsewhere("mjlab", "mjlab_dr.py", n)
        ours = n / writing.arenas_per_second(impl, [n])
        yield {"worlds": n, **theirs, "seconds": ours, "times_mjlab": theirs["mjlab_seconds"] / ours}


MJLAB_TERMS = {
    **{name: terms.HEAVY[name] for name in ("com", "armature")},
    **{name: terms.LIGHT[name] for name in ("damping", "friction_loss", "stiffness", "range", "kp", "kv", "force")},
    **{name: terms.LIGHT[name] for name in ("colour", "hand", "eye", "gaze", "fovy")},
    "mass": (dr.Term("body.mass_alone", ["arm_link.*", "arm_finger."]), terms.SCALED),
    "grip": (dr.Term("geom.friction", "arm_.*", axes=("sliding",)), terms.SCALED),
}
"""What `mjlab_terms.py` varies: inertias stay, gains are two, and friction is that of sliding."""


def mjlab_terms(impl: str, worlds: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Mjlab's `dr` on an arm, with what it derives then, and the same terms here; each call is waited for."""
    arena = mja.Arena.from_xml("<mujoco/>")
    arena.attach(terms.arm_xml(), "arm_")
    arena.vary(**{name: term for name, (term, _) in MJLAB_TERMS.items()})
    ranges = mja.ArenaRanges(terms={name: dist for name, (_, dist) in MJLAB_TERMS.items()})
    model = scene.model(arena, impl)
    write = jax.jit(lambda keys: scene.written(arena.randomize(model, keys, ranges)))
    for n in worlds:
        theirs = _elsewhere("mjlab", "mjlab_terms.py", n, stdin=terms.arm_xml())
        if theirs["dofs"] != arena.mj_model.nv:
            raise RuntimeError(f"comparison void: mjlab's arm has {theirs['dofs']} degrees of freedom")
        keys = scene.keys(n)
        ours = measure.interleaved({"ours": lambda keys=keys: jax.block_until_ready(write(keys))})["ours"]
        yield {
            "worlds": n,
            "terms": len(theirs["terms"]),
            "mjlab_seconds": theirs["mjlab_seconds"],
            "mjlab_without_recompute_seconds": theirs["mjlab_without_recompute_seconds"],
            "seconds": ours,
            "times_mjlab": theirs["mjlab_seconds"] / ours,
            **{name: theirs[name] for name in ("mjlab", "mujoco-warp", "warp-lang", "torch")},
        }


def _elsewhere(package: str, script: str, argument: int, stdin: str = "") -> dict[str, Any]:
    """What a script prints under the interpreter of an environment of its own (`make bench-rivals`)."""
    variable = f"MJX_ARENAS_{package.upper()}"
    python = pathlib.Path(os.environ.get(variable, measure.ROOT / f".venv-{package}" / "bin" / "python"))
    if not python.exists():
        raise measure.Skipped(f"{package} is not installed: `make bench-rivals`, or set {variable} to its Python")
    command = [str(python), str(measure.ROOT / "benchmarks" / script), str(argument)]
    env = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(command, env=env, input=stdin, capture_output=True, text=True, timeout=600)
    if done.returncode:
        raise RuntimeError(f"{script}: {done.stderr.strip().splitlines()[-1]}")
    return json.loads(done.stdout.splitlines()[-1])


def warp_alone(worlds: Sequence[int], n_steps: int, agree_steps: int) -> Iterator[dict[str, Any]]:
    """A rollout with impl='warp' against mujoco_warp with the same batched fields, capacities and start."""
    for n in worlds:
        batch, data = scene.start(scene.arena(), "warp", n)
        alone = WarpAlone(batch, data)
        ours = mja.rollout(batch, data, n_steps=agree_steps).qpos
        off = np.abs(np.asarray(ours) - alone.rollout(agree_steps)).max()
        if not off < MAX_DIFFERENCE:
            raise RuntimeError(f"comparison void: trajectories of {n} worlds differ by {off:.1e} m")
        seconds = measure.interleaved(
            {
                "ours": lambda batch=batch, data=data: mja.rollout(batch, data, n_steps),
                "alone": functools.partial(alone.rollout, n_steps, read=False),
            }
        )
        yield {
            "worlds": n,
            "steps_per_second": n * n_steps / seconds["ours"],
            "alone_steps_per_second": n * n_steps / seconds["alone"],
            "ours_over_alone": seconds["alone"] / seconds["ours"],
            "largest_qpos_difference": float(off),
        }


def rollout_length(worlds: int, n_steps: Sequence[int]) -> Iterator[dict[str, Any]]:
    """The same in rollouts of different lengths: a call costs something, too, which a step should not pay for."""
    batch, data = scene.start(scene.arena(), "warp", worlds)
    alone = WarpAlone(batch, data)
    runs = {}
    for n in n_steps:
        runs[f"ours {n}"] = functools.partial(mja.rollout, batch, data, n)
        runs[f"alone {n}"] = functools.partial(alone.rollout, n, read=False)
    seconds = measure.interleaved(runs)
    for n in n_steps:
        ours, theirs = seconds[f"ours {n}"], seconds[f"alone {n}"]
        yield {
            "worlds": worlds,
            "n_steps": n,
            "seconds_a_step": ours / n,
            "alone_seconds_a_step": theirs / n,
            "ours_over_alone": theirs / ours,
            "more_seconds_a_call": ours - theirs,
        }


class WarpAlone:
    """The worlds of a batch in mujoco_warp, as it comes with MJX; on a GPU one step is one CUDA graph."""

    def __init__(self, batch: mja.ArenaBatch, data: mjx.Data) -> None:
        import warp as wp
        from mujoco.mjx.third_party import mujoco_warp

        self.wp, self.device = wp, "cuda:0" if wp.is_cuda_available() else "cpu"
        with wp.ScopedDevice(self.device):
            self.model = mujoco_warp.put_model(batch.record.mj_model)
            batched = {name for name in batch.fields if hasattr(self.model, name)}
            self.model = mujoco_warp.put_model(batch.record.mj_model, dict.fromkeys(batched, batch.n_worlds))
            self.model.opt.warn_overflow = batch.model.opt._impl.warn_overflow
            for name in batched:
                getattr(self.model, name).assign(np.asarray(getattr(batch.model, name)))
            sizes = {name: getattr(data._impl, name) for name in ("naconmax", "naccdmax", "njmax")}
            self.data = mujoco_warp.make_data(batch.record.mj_model, nworld=batch.n_worlds, **sizes)
            for name in ("qpos", "geom_xpos", "geom_xmat"):
                getattr(self.data, name).assign(np.asarray(getattr(data, name)))
            self.start = wp.clone(self.data.qpos)
            self.step = functools.partial(mujoco_warp.step, self.model, self.data)
            if self.device != "cpu":
                self.step()  # loads the kernels
                with wp.ScopedCapture() as capture:
                    self.step()
                self.step = functools.partial(wp.capture_launch, capture.graph)

    def rollout(self, n_steps: int, read: bool = True) -> np.ndarray | None:
        """Steps from the start; gives qpos (W, nq) if it is to be read."""
        with self.wp.ScopedDevice(self.device):
            self.wp.copy(self.data.qpos, self.start)
            for array in (self.data.qvel, self.data.qacc_warmstart, self.data.time):
                array.zero_()
            for _ in range(n_steps):
                self.step()
            self.wp.synchronize_device()
            return self.data.qpos.numpy() if read else None


def c_mujoco(c_worlds: int, mjx_worlds: Mapping[str, int], n_steps: int) -> Iterator[dict[str, Any]]:
    """Steps of C MuJoCo on all cores (a recompiled model per world; per-world fields; one shared model) and of MJX."""
    arena, keys = scene.arena(), scene.keys(c_worlds)
    batch, data = scene.start(arena, "jax", c_worlds)
    qpos = np.asarray(data.qpos, float)
    nominal = arena.batch(scene.model(arena, "jax"), _repeated(arena.nominal_params(), c_worlds))
    runs = {
        "rollout_recompiled": (
            c_worlds,
            _c_rollout([arena.compile(batch.world(i)) for i in range(c_worlds)], qpos, n_steps),
        ),
        "c_batch": (c_worlds, _c_batch(arena.c_batch(batch.params, keys=keys), qpos, n_steps)),
        "batch_shared_model": (
            c_worlds,
            _shared_batch(arena.mj_model, np.asarray(scene.dropped(nominal).qpos), n_steps),
        ),
    }
    for impl, n in mjx_worlds.items():
        runs[f"mjx_{impl}"] = (n, functools.partial(mja.rollout, *scene.start(arena, impl, n), n_steps))
    seconds = measure.interleaved({name: run for name, (_, run) in runs.items()})
    for name, (n, _) in runs.items():
        yield {"with": name, "worlds": n, "steps_per_second": n * n_steps / seconds[name]}


def _repeated(params: mja.ArenaParams, n: int) -> mja.ArenaParams:
    return jax.tree.map(lambda x: np.broadcast_to(x, (n, *x.shape)), params)


def _c_rollout(models: Sequence[mujoco.MjModel], qpos: np.ndarray, n_steps: int) -> Callable[[], Any]:
    state = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros((len(models), mujoco.mj_stateSize(models[0], state)))
    for row, model, q in zip(start, models, qpos, strict=True):
        data = mujoco.MjData(model)
        data.qpos = q
        mujoco.mj_getState(model, data, row, state)
    datas = [mujoco.MjData(models[0]) for _ in os.sched_getaffinity(0)]
    return functools.partial(rollout.rollout, models, datas, start, nstep=n_steps, persistent_pool=True)


def _shared_batch(model: mujoco.MjModel, qpos: np.ndarray, n_steps: int) -> Callable[[], Any]:
    from mujoco import batch as mj_batch

    return _c_batch(mj_batch.Batch(model, len(qpos)), qpos, n_steps)


def _c_batch(batch: Any, qpos: np.ndarray, n_steps: int) -> Callable[[], Any]:
    def run() -> None:
        batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        batch.qpos = qpos
        batch.step(nstep=n_steps)

    return run
