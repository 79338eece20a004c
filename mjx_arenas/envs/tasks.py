"""The tasks that can be trained: what each is, on which arenas, and what it is judged on beside these."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from mjx_arenas.envs import lift, pick_and_place, push, reach
from mjx_arenas.envs.base import ArenaEnv
from mjx_arenas.params.params import ArenaRanges


class Task(NamedTuple):
    """One of them."""

    kind: Callable[..., ArenaEnv]
    training_ranges: Callable[[], ArenaRanges]
    wider_ranges: Callable[[], ArenaRanges]


def task(config: Mapping[str, Any]) -> Task:
    """Of the configuration of a training; of one from before there were several that of `Push`."""
    kind, module = {
        "push": (push.Push, push),
        "reach": (reach.Reach, reach),
        "lift": (lift.Lift, lift),
        "pick_and_place": (pick_and_place.PickAndPlace, pick_and_place),
    }[config.get("task", "push")]
    return Task(kind, module.training_ranges, module.wider_ranges)
