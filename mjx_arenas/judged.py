"""What a policy is worth, on arenas that it has not seen; and pictures of it."""

import pathlib
from collections.abc import Callable, Iterator
from typing import Any

from mjx_arenas.files import output


def evaluate(config: dict[str, Any], policy: Callable) -> dict[str, dict[str, Any]]:
    """Success at the end of one episode, on arenas that training has not seen: within the ranges and outside of them."""
    from mjx_arenas.envs import evaluate
    from mjx_arenas.envs.tasks import configured

    results = {}
    for where in ("held_out", "out_of_range"):
        env = configured.environment(config, where)
        if env is not None:
            results[where] = {"worlds": config["eval_worlds"], **evaluate.evaluate(policy, env, config["eval_worlds"])}
    return results


def strip(
    config: dict[str, Any], policy: Callable, picture: pathlib.Path, n_worlds: int = 4, n_frames: int = 6
) -> None:
    """Draws the policy on arenas that training has not seen, a row of frames for each; one that sees pictures as it sees them."""
    from mjx_arenas.envs import evaluate
    from mjx_arenas.viz import render

    env, first, kept = _played(config, policy, n_worlds)
    last = evaluate.episode_length(env) - 1
    shots = sorted({min(i, last) for i in (0, 6, 15, 30, 60, last)})[:n_frames]
    frames, labels, seen = [], [], kept[2]
    for world in range(n_worlds):
        frames += _outside(env, first, kept, world, shots) if seen is None else map(_enlarged, seen[shots, world])
        labels += [f"arena {world}, {(i + 1) * env.dt:.1f} s" for i in shots]
    with output.whole(picture) as unfinished:
        render.grid(frames, labels, columns=len(shots)).save(unfinished)


def film(config: dict[str, Any], policy: Callable, path: pathlib.Path, n_worlds: int = 9) -> None:
    """Films the policy on arenas that training has not seen, side by side, from outside."""
    from mjx_arenas.envs import evaluate
    from mjx_arenas.viz import film

    env, first, kept = _played(config, policy, n_worlds)
    length = evaluate.episode_length(env)
    worlds = [_outside(env, first, kept, world, range(length)) for world in range(n_worlds)]

    def frames() -> Iterator[list[Any]]:
        yield from map(list, zip(*worlds, strict=True))

    labels = [f"arena {world}" for world in range(n_worlds)]
    film.write_timed(path, film.Times(1, length, env.dt), frames(), labels)


def seen(config: dict[str, Any], policy: Callable, path: pathlib.Path, n_worlds: int = 9) -> None:
    """Films what a policy sees on the same arenas, side by side, at the speed of life."""
    from mjx_arenas.viz.seen import picture_video

    env, _, kept = _played(config, policy, n_worlds)
    picture_video(kept[2], path, 1 / env.dt, [f"arena {world}" for world in range(n_worlds)])


def _played(config: dict[str, Any], policy: Callable, n_worlds: int) -> tuple[Any, Any, tuple[Any, ...]]:
    """The environment, first states, and positions, goals and what is seen (T, W, ...) in an episode of the policy."""
    import jax
    import jax.numpy as jnp

    from mjx_arenas.envs import evaluate
    from mjx_arenas.envs.tasks import configured

    env: Any = configured.environment(config, "held_out")
    keys = jax.random.split(jax.random.key(evaluate.HELD_OUT), n_worlds)

    def record(state: Any) -> tuple[Any, ...]:
        views = [state.obs[name] for name in sorted(state.obs) if name.startswith("pixels/")]
        return state.data.qpos, state.data.mocap_pos, jnp.concatenate(views, axis=-2) if views else None

    return env, *evaluate.episode(env, policy, keys, record)


def _outside(env: Any, first: Any, kept: tuple[Any, ...], world: int, steps: Any) -> list[Any]:
    """Pictures of a world from outside, after these steps."""
    import jax

    from mjx_arenas.sim.data import blank

    info = {"episode": jax.tree.map(lambda x: x[world], first.info["episode"])}
    data, (qpos, goal) = blank(env.mj_model), (x[:, world] for x in kept[:2])  # Warp's has no single worlds
    states = [first.replace(data=data.replace(qpos=qpos[i], mocap_pos=goal[i]), info=info) for i in steps]
    return env.render(states, height=240, width=320)


def _enlarged(picture: Any, times: int = 3) -> Any:
    """Bytes of a policy's own picture, each pixel a square."""
    import numpy as np

    whole = np.round(255 * np.clip(np.asarray(picture), 0, 1)).astype(np.uint8)
    return whole.repeat(times, axis=0).repeat(times, axis=1)
