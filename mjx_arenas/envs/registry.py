"""The tasks under names in MuJoCo Playground's registry."""

from mujoco_playground import manipulation

from mjx_arenas.envs import lift, open_drawer, pick_and_place, push, reach, transfer


def register() -> None:
    """Registers our tasks with Playground's manipulation suite, each under its name after "Arena": "ArenaPush", "ArenaLift", ...

    Then `load` and `get_default_config` know them, of `mujoco_playground.manipulation` and of `mujoco_playground.registry`;
    `manipulation.ALL_ENVS` has them, `registry.ALL_ENVS` has not, as it is made when it is imported. Playground's `load`
    first downloads MuJoCo Menagerie, once, which these tasks do not need: `Push(config_overrides=...)` does without.
    """
    for name, kind, config in (
        ("ArenaPush", push.Push, push.default_config),
        ("ArenaTransfer", transfer.Transfer, transfer.default_config),
        ("ArenaReach", reach.Reach, reach.default_config),
        ("ArenaLift", lift.Lift, lift.default_config),
        ("ArenaOpenDrawer", open_drawer.OpenDrawer, open_drawer.default_config),
        ("ArenaPickAndPlace", pick_and_place.PickAndPlace, pick_and_place.default_config),
    ):
        manipulation.register_environment(name, kind, config)
