"""What C MuJoCo's contacts of boxes change on Warp: `mjx-arenas bench box_contacts FOLDER... --json FILE`.

Judges trained policies of `lift` or `pick_and_place`, each in its FOLDER, on Warp's own contacts of boxes (native) and on those that C
MuJoCo finds (as_in_c), on the same unseen arenas. Then steps the environment of the first with random actions, with both in turns.
"""

import argparse
import contextlib
import importlib.util
import json
import pathlib
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from unittest import mock

import mujoco

from benchmarks import measure
from mjx_arenas import gpu
from mjx_arenas.parser import Parser

NATIVE = int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
STEPS = 20  # control steps of one call


def main(argv: Sequence[str] | None = None) -> int:
    """Judges and measures, prints a line for each number and writes all of them."""
    parser = Parser(
        prog="mjx-arenas bench box_contacts", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=pathlib.Path, metavar="FOLDER", help="of a training")
    parser.add_argument("-n", "--worlds", type=int, default=4096, help="that are judged (default 4096)")
    parser.add_argument("--speed-worlds", type=int, default=8192, help="that are stepped (default 8192)")
    parser.add_argument("--json", type=pathlib.Path, required=True, help="file for the results")
    argv = sys.argv[1:] if argv is None else argv
    options = parser.parse_args(argv)
    for folder in options.folders:
        if not (folder / "config.json").is_file():
            parser.error(f"FOLDER must be the folder of a training, got {str(folder)!r}.")
    if importlib.util.find_spec("mujoco_playground") is None:
        parser.error("Policies need mujoco_playground: pip install 'mjx_arenas[train]'.")
    here = measure.environment()  # before this process takes the device
    gpu.leave_room("warp")
    from mjx_arenas import policies
    from mjx_arenas.envs import evaluate

    result = {"command": " ".join(["mjx-arenas bench box_contacts", *argv]), **here, "worlds": options.worlds}
    result["policies"] = []
    for folder in options.folders:
        row: dict[str, Any] = {"training": folder.name}
        for way in WAYS:
            row[way] = evaluate.evaluate(policies.load_policy(folder), environment(folder, way), options.worlds)
            print(folder, way, row[way], flush=True)
        result["policies"].append(row)
    step = {way: stepping(environment(options.folders[0], way), options.speed_worlds) for way in WAYS}
    seconds = measure.interleaved(step)
    result["steps_per_second"] = {way: options.speed_worlds * STEPS / seconds[way] for way in WAYS}
    print(result["steps_per_second"])
    options.json.parent.mkdir(parents=True, exist_ok=True)
    options.json.write_text(json.dumps(result, indent=1) + "\n")
    return 0


@contextlib.contextmanager
def native() -> Iterator[None]:
    """In which arenas of tasks keep Warp's own contacts of boxes."""
    from mjx_arenas.envs.tasks import lift, manipulation, pick_and_place

    def kept(arena: Any) -> Any:
        arena = manipulation.firm_grips(arena)
        arena.spec.option.disableflags &= ~NATIVE
        return arena

    with mock.patch.object(lift, "firm_grips", kept), mock.patch.object(pick_and_place, "firm_grips", kept):
        yield


WAYS = {"native": native, "as_in_c": contextlib.nullcontext}


def environment(folder: pathlib.Path, way: str) -> Any:
    """That of a training, on unseen arenas."""
    from mjx_arenas.envs.tasks import configured

    config = json.loads((folder / "config.json").read_text())
    with WAYS[way]():
        env = configured.environment(config, "held_out")
    if (way == "native") == bool(env.mj_model.opt.disableflags & NATIVE):
        raise ValueError(f"{folder} is no training of lift or pick_and_place in their own arenas.")
    return env


def stepping(env: Any, worlds: int) -> Callable[[], Any]:
    """A call steps all worlds `STEPS` times from the start of an episode, each with actions of its own."""
    import jax

    state = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.key(0), worlds))
    actions = jax.random.uniform(jax.random.key(1), (worlds, env.action_size), minval=-1, maxval=1)

    def many(state: Any) -> Any:
        return jax.lax.scan(lambda state, _: (jax.vmap(env.step)(state, actions), None), state, None, STEPS)[0]

    run = jax.jit(many)
    return lambda: run(state)


if __name__ == "__main__":
    sys.exit(main())
