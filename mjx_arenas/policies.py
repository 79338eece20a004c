"""Networks of policies, and policies of finished trainings."""

import functools
import os
import pathlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from mjx_arenas import settings
from mjx_arenas.extras import extra
from mjx_arenas.problem import problem
from mjx_arenas.problems.messages import error
from mjx_arenas.rules.validation import check_path
from mjx_arenas.trained import read

if TYPE_CHECKING:
    from mjx_arenas.envs import ArenaEnv
    from mjx_arenas.envs.trained_policy import TrainedPolicy


def maker(config: dict[str, Any]) -> Callable:
    """The function of Brax that makes the networks of a training; it takes what `network_factory` gives."""
    from brax.training.agents.ppo import networks, networks_vision

    if settings.sees_pictures(config):
        return networks_vision.make_ppo_networks_vision
    return networks.make_ppo_networks


def networks(config: dict[str, Any]) -> Callable:
    """Brax's factory of the networks of a training."""
    factory = settings.learner(config)["network_factory"]
    given = {name: tuple(x) if isinstance(x, list | tuple) else x for name, x in factory.items()}
    make = functools.partial(_that_see, maker(config)) if settings.sees_pictures(config) else maker(config)
    return functools.partial(
        make, **{"value_obs_key": "privileged_state", **given, "policy_obs_key": _observed(config)}
    )


def _observed(config: dict[str, Any]) -> str:
    """The name of the observation, beside pictures, that a policy sees: what its networks are told to read, if they are."""
    by_default = "privileged_state" if config["sees"] == "everything" else "state"
    return settings.learner(config)["network_factory"].get("policy_obs_key", by_default)


def check_observed(config: dict[str, Any], env: "ArenaEnv") -> None:
    """Refuses networks that are told to read observations that the environment does not have.

    Raises:
        ValueError: they are.
    """
    import jax

    factory = settings.learner(config)["network_factory"]
    if told := {name: factory[name] for name in ("policy_obs_key", "value_obs_key") if name in factory}:
        obs = jax.eval_shape(env.reset, jax.random.key(0)).obs
        must = f"one of the observations {', '.join(map(repr, obs))}"
        for name in (name for name, key in told.items() if key not in obs):
            raise error(
                [problem(f"{settings.part(config)}.network_factory.{name}", "must", None, told[name], must=must)]
            )


def _that_see(
    make: Callable, observation_size: Any, action_size: int, preprocess_observations_fn: Any = None, **given: Any
) -> Any:
    """The policy of Brax's vision networks for PPO, for its `bc`, whose own have a frozen encoder."""
    from brax.training.agents.bc import networks as bc_networks

    del preprocess_observations_fn  # pictures are from 0 to 1, and what else there is, in metres and seconds, about 1
    both: Any = make(observation_size, action_size, **given)
    kind: Any = bc_networks.BCNetworks
    return kind(both.policy_network, both.parametric_action_distribution)


def load_policy(folder: str | os.PathLike) -> "TrainedPolicy":
    """Loads the policy of the last finished stage of a training.

    Args:
        folder: folder that the training's `--out` named.

    Returns:
        `policy(observation, key)`, as in Brax; jit, vmap. It takes observations of any number of worlds, a dict with "state" (..., m). It
            returns actions (..., n) within -1 and 1, and a dict with "loc" and "scale" of the normal distribution (..., n) that `tanh`
            takes to actions. It is deterministic: it gives its best action, and does not use the key.

        It refuses observations of another task, whose names or sizes are others.

    Raises:
        ValueError: there is no such training.
        ImportError: Brax is not installed.
    """
    extra("brax", "train")
    from brax.training import checkpoint, types
    from brax.training.acme import running_statistics
    from brax.training.agents.bc import networks as bc_networks

    from mjx_arenas.envs.trained_policy import TrainedPolicy

    check_path("folder", folder)
    folder = pathlib.Path(folder).resolve()
    stages = folder.glob("checkpoints/stage*/params")
    last = max(stages, key=lambda params: int(params.parent.name.removeprefix("stage")), default=None)
    if last is None:
        wanted = "a folder in which `mjx-arenas train TASK -o FOLDER` has finished a stage"
        raise error([problem("folder", "must", None, str(folder), must=wanted, near=_around(folder))])
    # Brax 0.14.2's own `load_policy` fails on the defaults of the networks that its `train` writes.
    config = read(folder / "config.json")
    (of_network,) = last.glob("*_network_config.json")
    saved = read(of_network, "broken_policy")
    prepared = (
        running_statistics.normalize if saved["normalize_observations"] else types.identity_observation_preprocessor
    )
    params = checkpoint.load(str(last))
    sizes = {name: mean.shape for name, mean in params[0].mean.items()}
    network = networks(config)(sizes, saved["action_size"], prepared)
    act, key = bc_networks.make_inference_fn(network)(params, tanh_squash=True), _observed(config)
    pictures = saved["observation_size"].items() if settings.sees_pictures(config) else ()  # which nothing normalizes
    views = {name: tuple(size) for name, size in pictures if name.startswith("pixels/")}
    return TrainedPolicy(act, config["task"], {key: sizes[key], **views})


def _around(folder: pathlib.Path) -> str:
    """The end of a sentence about a folder that is no training's: the training in which it is, or that is in it."""
    above = [path for path in folder.parents if _is_training(path)]
    if above:
        return f", which is in the folder of a training, {str(above[0])!r}"
    inside = [path for path in sorted(folder.glob("*")) if _is_training(path)]
    return f", in which there is the folder of a training, {str(inside[0])!r}" if inside else ""


def _is_training(folder: pathlib.Path) -> bool:
    return (folder / "config.json").is_file() and (folder / "checkpoints").is_dir()


def load_env(
    folder: str | os.PathLike, config_overrides: Mapping[str, Any] | None = None, wider: bool = False
) -> "ArenaEnv":
    """Makes the environment in which the policy of a training is judged: its task, robot and ranges, with a new arena in every episode.

    Args:
        folder: folder that the training's `--out` named. Files that its configuration names must still be there, and modules of tasks and
            arms of your own be importable.
        config_overrides: dotted names and values over those of the training, such as `{"impl": "jax"}`.
        wider: whether its ranges are those beyond the training's.

    Raises:
        ValueError: there is no such training, or it has no wider ranges; as of the task.
    """
    from mjx_arenas.envs.config import check_overrides
    from mjx_arenas.envs.tasks import configured

    check_path("folder", folder)
    saved = pathlib.Path(folder).resolve() / "config.json"
    if not saved.is_file():
        raise error(
            [
                problem(
                    "folder",
                    "must",
                    None,
                    str(saved.parent),
                    must="the folder of a training",
                    near=_around(saved.parent),
                )
            ]
        )
    check_overrides(config_overrides)
    where = "out_of_range" if wider else "held_out"
    env = configured.environment(read(saved), where, config_overrides)
    if env is None:
        must = f"False, as the training in {saved.parent} has no `wider_ranges`"
        raise error([problem("wider", "must", None, wider, must=must)])
    return env
