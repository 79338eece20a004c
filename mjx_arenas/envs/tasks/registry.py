"""The tasks under names in MuJoCo Playground's registry."""

from mujoco_playground import manipulation

from mjx_arenas.envs.tasks import lift, open_drawer, pick_and_place, push, reach, transfer


def register() -> None:
    """Registers the tasks of this library with Playground's manipulation suite, as "ArenaPush", "ArenaLift" and so on.

    Then `load` and `get_default_config` of `mujoco_playground.manipulation` and of `mujoco_playground.registry` know them.
    `manipulation.ALL_ENVS` has them; `registry.ALL_ENVS` does not, because it is built at import.

    Playground's `load` first downloads MuJoCo Menagerie, once. These tasks do not need it: `Push(config_overrides=...)` works without.
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
