"""Domain randomization of MuJoCo Playground's Go1, which stays as it is: `python docs/examples/quadruped.py`."""

import argparse
import functools
import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx

import mjx_arenas as mja
from mjx_arenas import dr

try:
    from etils import epath
    from mujoco_playground import registry, wrapper
    from mujoco_playground._src import mjx_env
except ImportError:
    raise SystemExit("This example needs MuJoCo Playground: pip install 'mjx_arenas[train]'.") from None

PICTURE = pathlib.Path(__file__).with_suffix(".png")


def randomized(env: mjx_env.MjxEnv) -> tuple[mja.Arena, mja.ArenaRanges]:
    """The arena of an environment's own MJCF, and what varies in it."""
    spec = mujoco.MjSpec.from_file(env.xml_path, assets=env.model_assets)
    for name in ("timestep", "ccd_iterations"):  # which Go1Env sets after it has compiled
        setattr(spec.option, name, getattr(env.mj_model.opt, name))
    arena = mja.Arena.from_xml(spec)
    preset = dr.robot(arena.spec)  # mass, com, armature, friction_loss, damping, kp, friction
    del preset.terms["friction"], preset.ranges["friction"]  # Go1's floor decides alone, by its priority
    arena.vary(
        **preset.terms,
        floor=dr.Term("geom.friction", "floor", axes="sliding"),
        paint=dr.Term("material.rgba", "dark", axes=("red", "green", "blue")),  # to tell worlds apart
    )
    ranges = preset.ranges | {
        "mass": mja.Uniform(0.7, 1.5, relative="scale"),  # of each link, with its inertia and all that follows
        "com": mja.Uniform(-0.02, 0.02, relative="add"),
        "floor": mja.LogUniform(0.2, 1.2),
        "paint": mja.Uniform(0.1, 0.9),
    }
    return arena, mja.ArenaRanges(terms=ranges)


def trot(step: int) -> np.ndarray:
    """(12,) actions of an open-loop trot: abduction, hip and knee of each leg."""
    phase = 2 * np.pi * step / 20 + np.pi * np.array([0, 1, 1, 0])  # FR, FL, RR, RL
    return np.stack([0 * phase, 0.3 * np.sin(phase), 0.5 * np.cos(phase)], axis=1).ravel()


def main(
    menagerie: str | None = None, worlds: int = 8, steps: int = 30, picture: pathlib.Path | None = PICTURE
) -> tuple[dict[str, float], jax.Array]:
    """Steps the wrapped environment; gives how far worlds are from recompiled ones, and where robots end."""
    if menagerie is not None:
        mjx_env.MENAGERIE_PATH = epath.Path(menagerie)  # else Playground downloads it
    env = registry.load("Go1JoystickFlatTerrain", config_overrides={"impl": "warp", "naconmax": 16 * worlds})
    arena, ranges = randomized(env)
    randomize = arena.randomization_fn(ranges)  # Brax's: ppo.train(environment=env, randomization_fn=randomize, ...)

    def quiet(model: mjx.Model, rng: jax.Array) -> tuple[mjx.Model, mjx.Model]:
        """Without Warp's lines on the solver, to which Playground gives one iteration."""
        quieted: Any = model.tree_replace({"opt._impl.warn_overflow": 0})
        return randomize(quieted, rng)

    keys = jax.random.split(jax.random.PRNGKey(1), worlds)
    train_env = wrapper.wrap_for_brax_training(env, randomization_fn=functools.partial(quiet, rng=keys))
    reset, step = jax.jit(train_env.reset), jax.jit(train_env.step)
    state = reset(jnp.stack([keys[0]] * worlds))  # the same start in all worlds, and then the same actions:
    for i in range(steps):
        state = step(state, jnp.tile(trot(i), (worlds, 1)))

    model, in_axes = randomize(env.mjx_model, keys)
    print(mja.check_randomization(env.mjx_model, model, in_axes, env))
    params = jax.vmap(lambda key: arena.sample_params(key, ranges))(mja.trainers_keys(keys))  # of the same worlds
    each = [mja.take(params, i) for i in range(worlds)]
    off = mja.differences(model, {i: arena.compile(one) for i, one in enumerate(each)})
    print(
        f"{worlds} worlds against MuJoCo's compiler: no number is off by more than {max(off.values()):.1e} of itself."
    )

    if picture is not None:
        masses = model.body_subtreemass[:, arena.mj_model.body("trunk").id]
        labels = [f"floor {p.terms['floor'][0, 0]:.2f}, {m:.1f} kg" for p, m in zip(each, masses, strict=True)]
        view = mujoco.MjvCamera()
        view.azimuth, view.elevation, view.distance = 130, -20, 1.15
        view.lookat = np.append(np.mean(state.data.qpos[:, :2], axis=0), 0.17)
        arena.contact_sheet(params, state.data, labels, camera=view, width=304, height=228).save(picture, optimize=True)
    return off, state.data.qpos[:, :3]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--menagerie", help="a folder with MuJoCo Menagerie's unitree_go1; default: Playground downloads it"
    )
    main(**vars(parser.parse_args()))
