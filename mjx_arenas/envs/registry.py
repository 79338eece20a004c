"""The tasks under names in MuJoCo Playground's registry."""

from mujoco_playground import manipulation

from mjx_arenas.envs import push, transfer


def register() -> None:
    """Registers "ArenaPush" and "ArenaTransfer" with Playground's manipulation suite.

    Then `load` and `get_default_config` know them, of `mujoco_playground.manipulation` and of `mujoco_playground.registry`;
    `manipulation.ALL_ENVS` has them, `registry.ALL_ENVS` has not, as it is made when it is imported. Playground's `load`
    first downloads MuJoCo Menagerie, once, which these tasks do not need: `Push(config_overrides=...)` does without.
    """
    manipulation.register_environment("ArenaPush", push.Push, push.default_config)
    manipulation.register_environment("ArenaTransfer", transfer.Transfer, transfer.default_config)
