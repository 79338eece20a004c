"""Networks of policies, and policies of finished trainings."""

import functools
import json
import os
import pathlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import jax

HIDDEN = {"policy_hidden_layer_sizes": (128, 128, 128), "value_hidden_layer_sizes": (256, 256, 256)}
CNN = {
    "cnn_output_channels": (32, 64, 64),
    "cnn_kernel_size": (8, 4, 3),
    "cnn_stride": (4, 2, 1),
    "cnn_global_pool": "spatial_softmax",
}
"""Of policies that see pictures: where each of 64 features is."""


def networks(config: dict[str, Any]) -> Callable:
    """Brax's factory of the networks of a training."""
    from brax.training.agents.ppo import networks as ppo_networks

    keys = {"policy_obs_key": "state", "value_obs_key": "privileged_state"}
    given = {name: tuple(x) if isinstance(x, list | tuple) else x for name, x in config["networks"].items()}
    factory = _pixel_networks if config.get("pixels") else ppo_networks.make_ppo_networks
    return functools.partial(factory, **keys, **given)


def _pixel_networks(
    observation_size: Any, action_size: int, value_hidden_layer_sizes: Any = (256,), **given: Any
) -> Any:
    """Brax's vision network as policy; the critic, which is told all that it must know, needs no pictures."""
    from brax.training.agents.ppo import networks as ppo_networks
    from brax.training.agents.ppo import networks_vision

    sees: Any = networks_vision.make_ppo_networks_vision(observation_size, action_size, **given)
    plain = {name: x for name, x in given.items() if not name.startswith(("cnn_", "policy_hidden"))}
    told = ppo_networks.make_ppo_networks(
        observation_size, action_size, value_hidden_layer_sizes=value_hidden_layer_sizes, **plain
    )
    return sees.replace(value_network=told.value_network)


def load_policy(folder: str | os.PathLike) -> "Callable[[Any, jax.Array], tuple[jax.Array, Mapping]]":
    """The policy of the last stage that a training has finished.

    Args:
        folder: the training's `--out`.

    Returns:
        `policy(observation, key)`, Brax's convention: actions (..., n) within -1 and 1 for the observations (a dict with
        "state" (..., m)) of any number of worlds, and an empty dict. It gives its best action, and does not use the key; jit, vmap.

    Raises:
        ValueError: there is no such training.
    """
    from brax.training.acme import running_statistics
    from brax.training.agents.ppo import checkpoint
    from brax.training.agents.ppo import networks as ppo_networks

    folder = pathlib.Path(folder).resolve()
    stages = folder.glob("checkpoints/stage*/params")
    last = max(stages, key=lambda params: int(params.parent.name.removeprefix("stage")), default=None)
    if last is None:
        wanted = "a folder in which `python -m mjx_arenas.train --out FOLDER` has finished a stage"
        raise ValueError(f"`folder` must be {wanted}, got {str(folder)!r}.")
    # Brax 0.14.2's own `load_policy` fails on the defaults of the networks that its `train` writes.
    config = json.loads((folder / "config.json").read_text())
    action_size = json.loads((last / "ppo_network_config.json").read_text())["action_size"]
    params = checkpoint.load(str(last))
    sizes = {name: mean.shape for name, mean in params[0].mean.items()}
    given = (
        {"preprocess_observations_fn": running_statistics.normalize} if config["ppo"]["normalize_observations"] else {}
    )
    network = networks(config)(sizes, action_size, **given)
    policy: Any = ppo_networks.make_inference_fn(network)(params, deterministic=True)
    return policy
