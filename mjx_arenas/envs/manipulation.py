"""What tasks of arms share: how actions move them, and what policies know of themselves."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from ml_collections import config_dict
from mujoco import mjx

from mjx_arenas import dr, quaternions
from mjx_arenas.arena import Arena
from mjx_arenas.envs import arms, chain
from mjx_arenas.envs.arms import Arm
from mjx_arenas.envs.base import ArenaEnv, Episode, RangesAt, env_config
from mjx_arenas.params.params import ArenaParams, ArenaRanges

STEP = 0.04  # [m] that an action moves the tool at most, along each axis
TURN = 0.2  # [rad] that it turns it
JOINT_STEP = 0.15  # [rad] or [m] that an action moves a joint
AHEAD = 0.4  # [rad] or [m] that a servo's target is ahead of its joint at most
UPRIGHT = 0.5  # of a tilt of the tool, which a step takes back
PREFIX = "arm_"
START = "arm_start"
"""The quantity by which joints start beside the keyframe, [rad] or [m]."""


def default_config(episode_length: int = 150) -> config_dict.ConfigDict:
    """Times in [s]. `action` is "cartesian" or "joint": see `ArmTask`."""
    config = env_config(ctrl_dt=0.04, sim_dt=0.004, episode_length=episode_length)
    config.action = "cartesian"
    return config


class Hand(NamedTuple):
    """What an arm knows of itself, in the frame of its base."""

    q: jax.Array
    """(n,) of its joints [rad] or [m]."""
    velocity: jax.Array
    """(n,)"""
    grip: jax.Array
    """(f,) of its fingers' joints."""
    tool: chain.Tool


class ArmTask(ArenaEnv):
    """An arm with a gripper, which points down, and a task.

    Actions are within -1 and 1. With `config.action` "cartesian" they are steps of the tool along x, y and z of the arm's base, at most
    4 cm, a turn about the vertical, at most 0.2 rad, and the grip, 1 open, -1 closed; inverse kinematics keep the tool pointing down. With
    "joint" they are steps of the joints, at most 0.15 rad, and the grip. A step moves the targets of servos.

    Args:
        arena: with its objects; not compiled yet.
        arm: as of `arms.small()`.
        on: the table, by index or name, or the surface or part of furniture that carries the arm; None: it stands in the world.
        pos: (3,) of its base there [m].
        ranges: as in `ArenaEnv`. The quantity "arm_start" is added to the joints with which an arm starts.
        config: as in `ArenaEnv`.
        config_overrides: dotted names and values.

    Raises:
        ValueError: a joint of the arm has no servo; `config.action` is another one; as of `ArenaEnv` and `arena.attach`.
    """

    def __init__(
        self,
        arena: Arena,
        arm: Arm,
        on: int | str | None,
        pos: Any,
        ranges: ArenaRanges | RangesAt,
        config: config_dict.ConfigDict,
        config_overrides: Mapping[str, Any] | None,
    ) -> None:
        alone = arm.spec.compile()
        self._chain = chain.chain(alone, arm.base, arm.tool)
        servos = arms.actuators(arm, self._chain.joints)
        arena.attach(arm.spec, prefix=PREFIX, pos=pos, on=on)
        arena.vary(**{START: dr.Term("joint.qpos", [PREFIX + name for name in self._chain.joints])})
        super().__init__(arena, ranges, config, config_overrides, keyframe=PREFIX + arms.HOME)
        if self._config.action not in ("cartesian", "joint"):
            raise ValueError(f"`config.action` must be 'cartesian' or 'joint', got {self._config.action!r}.")
        model = self.arena.mj_model
        joints = [model.joint(PREFIX + name) for name in self._chain.joints]
        self._q = np.array([joint.qposadr[0] for joint in joints])
        self._v = np.array([joint.dofadr[0] for joint in joints])
        self._range = np.array([joint.range for joint in joints]).T
        self._servo = np.array([model.actuator(PREFIX + name).id for name in servos])
        grips = [model.actuator(PREFIX + name) for name in arm.fingers]
        self._grip = np.array([grip.id for grip in grips])
        fingers = [model.joint(int(grip.trnid[0])) for grip in grips]
        self._finger_names = tuple(finger.name for finger in fingers)
        self._fingers = np.array([finger.qposadr[0] for finger in fingers])
        self._closed, self._open = np.array(list(arm.fingers.values())).T
        self._base = model.body(PREFIX + arm.base).id
        self._thing = model.joint(arena.objects[0].joint).dofadr[0] if arena.objects else 0

    @property
    def action_size(self) -> int:
        """Five for Cartesian steps, else one more than joints."""
        return 5 if self._config.action == "cartesian" else len(self._q) + 1

    @property
    def arm_joints(self) -> tuple[str, ...]:
        """Names of the joints from the arm's base to its tool."""
        return tuple(PREFIX + name for name in self._chain.joints)

    @property
    def finger_joints(self) -> tuple[str, ...]:
        """Names of the joints that its gripper's actuators move."""
        return self._finger_names

    def drive(self, data: mjx.Data, episode: Episode, action: jax.Array) -> jax.Array:
        before = data.ctrl[self._servo]
        if self._config.action == "joint":
            change = JOINT_STEP * action[:-1]
        else:
            at = chain.tool(self._chain, before)
            tilt = jnp.cross(at.mat[:, 2], jnp.array([0.0, 0.0, -1.0]))
            about = UPRIGHT * tilt + jnp.array([0.0, 0.0, TURN]) * action[3]
            change = chain.steps(at.jacobian, jnp.concatenate([STEP * action[:3], about]))
        q = data.qpos[self._q]
        target = jnp.clip(
            before + change, jnp.maximum(self._range[0], q - AHEAD), jnp.minimum(self._range[1], q + AHEAD)
        )
        grip = self._closed + (self._open - self._closed) * (action[-1] + 1) / 2
        return data.ctrl.at[self._servo].set(target).at[self._grip].set(grip)

    def hand(self, data: mjx.Data) -> Hand:
        """The arm, as it knows itself."""
        q = data.qpos[self._q]
        return Hand(q, data.qvel[self._v], data.qpos[self._fingers], chain.tool(self._chain, q))

    def local(self, data: mjx.Data, pos: jax.Array) -> jax.Array:
        """(3,) a point of the world in the frame of the arm's base [m]."""
        return data.xmat[self._base].T @ (pos - data.xpos[self._base])

    def thing(self, data: mjx.Data) -> tuple[jax.Array, jax.Array]:
        """(3,) where the first object is in the frame of the arm's base [m], and (3, 3) how it is turned there."""
        at = self.arena.layout.object_qpos[0]
        mat = quaternions.quat_to_mat(quaternions.normalize(data.qpos[at[3:]]))
        return self.local(data, data.qpos[at[:3]]), data.xmat[self._base].T @ mat

    def thing_velocity(self, data: mjx.Data) -> jax.Array:
        """(3,) of the first object in the axes of the arm's base [m/s]."""
        return data.xmat[self._base].T @ data.qvel[self._thing : self._thing + 3]

    def proprioception(self, data: mjx.Data) -> jax.Array:
        hand = self.hand(data)
        tool = hand.tool
        return jnp.concatenate([hand.q, 0.1 * hand.velocity, hand.grip, tool.pos, tool.mat[:2, 0]])


def thing_numbers(params: ArenaParams) -> list[jax.Array]:
    """Of the first object, for a critic: size, mass and friction; 5 numbers."""
    return [params.object_full_sizes[0], params.object_masses[:1], params.object_frictions[0, :1]]
