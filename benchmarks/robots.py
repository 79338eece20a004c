"""Arms of other packages as they are and simplified: what collides, how far shapes change, how fast they step."""

import functools
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

import mjx_arenas as mja
from benchmarks import measure, scene

HOMES: Mapping[str, Sequence[float]] = {  # [rad]; the joints of grippers are 0
    "panda": (0, 0.1, 0, -2.2, 0, 2.3, 0.8),
    "ur5e": (-1.57, -1.57, 1.57, -1.57, -1.57, 0),
    "ur5e_2f85": (-1.57, -1.57, 1.57, -1.57, -1.57, 0),
    "yam": (0, 1.0, 1.0, 0, 0, 0),
    "xarm7": (0, -0.3, 0, 0.8, 0, 1.1, 0),
}
LINKAGE = (
    "(2f85_)?(left|right)_(driver|coupler|spring_link|follower)"  # bars of a 2F-85, which touch nothing that is held
)
FAST: Mapping[str, Mapping[str, Any]] = {  # fingertips stay
    "panda": {"collision": {LINKAGE: "none", "link0": "hull", ".*": "primitive"}, "keep": "(left|right)_pad.*"},
    "ur5e": {},
    "ur5e_2f85": {"collision": {LINKAGE: "none", ".*": "primitive"}, "keep": "2f85_(left|right)_pad.*"},
    "yam": {"collision": {"[lr]f_(rot.|down([1-3]|[6-9]|1.))_collision": "none"}, "keep": "[lr]f_down[45]_collision"},
    "xarm7": {
        "collision": {"(left|right)_(outer|inner)_knuckle": "none", ".*": "primitive"},
        "keep": "(left|right)_finger",
    },
}
NOISE, C_STATES, C_STEPS = 0.1, 16, 25  # about home [rad]


def made(name: str, how: str) -> tuple[mujoco.MjSpec, mja.SimplifyReport]:
    """An arm, with a keyframe "home", and a report against what it was.

    Args:
        name: one of `mja.robots.known()`.
        how: "as_it_is", "hull" or "primitive" as `simplify` says, or "fast": what is in `FAST`, nothing drawn that does not collide,
            and no contacts of the arm with itself but those of the fingertips.
    """
    spec = _loaded(name)
    if how == "as_it_is":
        return spec, mja.simplify(spec, "mesh", options={})[1]
    asked = {"collision": how} if how != "fast" else {"self_collisions": False, "visual": False, **FAST[name]}
    return mja.simplify(spec, **asked)


@functools.cache
def _loaded(name: str) -> mujoco.MjSpec:
    """The arm as its package has it, with a keyframe "home" alone."""
    try:
        spec = mja.robots.load(name)
    except ModuleNotFoundError as missing:
        raise measure.Skipped(str(missing)) from None
    for key in list(spec.keys):
        spec.delete(key)
    nq = spec.copy().compile().nq
    spec.add_key(name="home", qpos=np.pad(HOMES[name], (0, nq - len(HOMES[name]))))
    return spec


def arena(robot: mujoco.MjSpec) -> mja.TableArena:
    """An arm on a table with three objects."""
    objects = [mja.Object(f"cube{k}", full_size=0.05, pos=(0.25, 0.2 * k - 0.2)) for k in range(3)]
    one = mja.TableArena((1.2, 1.0, 0.05), objects=objects)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "`robot`: geoms are inside each other")  # of a Panda at `qpos0`
        one.attach(robot, "r_", pos=(-0.4, 0, 0.01), on=0)
    return one


def robots(
    names: Sequence[str],
    hows: Sequence[str],
    on_device: Sequence[str],
    impl: str,
    worlds: int,
    n_steps: int,
    seconds: float,
) -> Iterator[dict[str, Any]]:
    """Each arm in each form in C MuJoCo, and in some in many worlds at once on the device; the forms of one arm in turns."""
    ranges = mja.ArenaRanges(
        table_offsets=mja.Uniform([0, 0, -0.2], [0, 0, 0.2], relative="add"),
        table_frictions=mja.Uniform([0.5, 1, 1], [1.5, 1, 1], relative="scale"),
    )
    for name in names:
        reports, arenas, device = {}, {}, {}
        for how in hows:
            robot, report = made(name, how)
            if how in on_device or report.reshaped:  # or it is the arm as it is
                reports[how], arenas[how] = report, arena(robot)
        for how in (how for how in on_device if worlds):
            model, keys = scene.model(arenas[how], impl), scene.keys(worlds)
            batch = arenas[how].randomize(model, keys, ranges)
            data = mja.make_data(batch, keys, keyframe="r_home")
            device[how] = functools.partial(mja.rollout, batch, data, n_steps)
        c_runs = {how: _c_steps(one.mj_model) for how, one in arenas.items()}
        c_seconds = measure.interleaved(c_runs, sample_seconds=seconds)
        device_seconds = measure.interleaved(device, sample_seconds=seconds)
        for how, report in reports.items():
            row = {
                "robot": name,
                "how": how,
                "pairs": report.after.pairs,
                "colliding": report.after.colliding,
                "corners": report.after.vertices,
                "geoms": report.after.colliding + report.after.drawn,
                "largest_change_mm": 1e3 * report.largest_change,
                "c_steps_per_second": C_STATES * C_STEPS / c_seconds[how],
                "c_times_as_it_is": c_seconds[hows[0]] / c_seconds[how],
            }
            if how in device:
                row |= {
                    "impl": impl,
                    "worlds": worlds,
                    "steps_per_second": worlds * n_steps / device_seconds[how],
                    "times_as_it_is": device_seconds[hows[0]] / device_seconds[how],
                }
            yield row


def _c_steps(model: mujoco.MjModel) -> Callable[[], float]:
    """Steps the arm in C MuJoCo, one core, from states near home, from which it falls."""
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    home = model.key("r_home").qpos
    arm = [int(model.jnt_qposadr[j]) for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE][:6]
    states = [home + NOISE * np.bincount(arm, rng.uniform(-1, 1, len(arm)), model.nq) for _ in range(C_STATES)]

    def run() -> float:
        for state in states:
            mujoco.mj_resetData(model, data)
            data.qpos[:] = state
            mujoco.mj_step(model, data, C_STEPS)
        return float(data.qpos[0])

    return run
