"""What a policy is worth, on arenas that it has not seen; and pictures of it."""

import pathlib
from collections.abc import Callable
from typing import Any

from mjx_arenas.files import output


def evaluate(config: dict[str, Any], policy: Callable) -> dict[str, dict[str, Any]]:
    """Success at the end of one episode, on arenas that training has not seen: within the ranges and outside of them."""
    from mjx_arenas.envs import evaluate, push, tasks

    results, pixels, task = {}, config.get("sees") == "pictures", tasks.task(config)
    overrides = {"impl": config["impl"]} | _seeing(pixels)
    for where, ranges in {"held_out": task.training_ranges(), "out_of_range": task.wider_ranges()}.items():
        ranges = push.with_looks(ranges) if pixels else ranges
        env = task.kind(config_overrides=overrides, ranges=ranges)
        results[where] = {"worlds": config["eval_worlds"], **evaluate.evaluate(policy, env, config["eval_worlds"])}
    return results


def strip(
    config: dict[str, Any], policy: Callable, picture: pathlib.Path, n_worlds: int = 4, n_frames: int = 6
) -> None:
    """Draws the policy on arenas that training has not seen, a row of frames for each; one that sees pictures as it sees them."""
    import jax

    from mjx_arenas.envs import evaluate, tasks
    from mjx_arenas.viz import render

    # With impl="jax": a few worlds, and MJX on Warp gives no single one of them back.
    task = tasks.task(config)
    env: Any = task.kind(config_overrides=_seeing(config.get("sees") == "pictures"))
    keys = jax.random.split(jax.random.key(evaluate.HELD_OUT), n_worlds)
    shots = [0, 6, 15, 30, 60, env._config.episode_length - 1][:n_frames]

    def record(state: Any) -> tuple[Any, ...]:
        return state.data.qpos, state.data.mocap_pos, state.obs.get("pixels/view_0")

    first, kept = evaluate.episode(env, policy, keys, record)
    frames, labels = [], []
    for world in range(n_worlds):
        state = jax.tree.map(lambda x, w=world: x[w], first)
        for i in shots:
            qpos, goal, seen = jax.tree.map(lambda x, i=i, w=world: x[i, w], kept)
            frames.append(_outside(env, state, qpos, goal) if seen is None else _enlarged(seen))
            labels.append(f"arena {world}, {(i + 1) * env.dt:.1f} s")
    with output.whole(picture) as unfinished:
        render.grid(frames, labels, columns=n_frames).save(unfinished)


def _seeing(pixels: bool) -> dict[str, Any]:
    return {"vision": True} if pixels else {}


def _outside(env: Any, state: Any, qpos: Any, goal: Any) -> Any:
    """A picture from the side."""
    import mujoco

    camera = mujoco.MjvCamera()
    camera.lookat = [*state.info["episode"].params.table_offsets[0, :2], 0.75]
    camera.distance, camera.azimuth, camera.elevation = 1.9, 125, -35
    data = state.data.replace(qpos=qpos, mocap_pos=goal)
    return env.render(state.replace(data=data), height=240, width=320, camera=camera)


def _enlarged(picture: Any, times: int = 3) -> Any:
    """Bytes of a policy's own picture, each pixel a square."""
    import numpy as np

    whole = np.round(255 * np.clip(np.asarray(picture), 0, 1)).astype(np.uint8)
    return whole.repeat(times, axis=0).repeat(times, axis=1)
