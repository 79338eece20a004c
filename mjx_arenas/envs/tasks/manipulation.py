"""What tasks of arms share: how actions move them, and what policies know of themselves."""

import inspect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypedDict, Unpack

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from ml_collections import config_dict
from mujoco import mjx
from mujoco_playground import State

from mjx_arenas import dr, quaternions
from mjx_arenas.arena import Arena
from mjx_arenas.envs import flaws, refusals
from mjx_arenas.envs.arms import chain, dynamics, graspable, grips, known, moves, servos, wrist_camera
from mjx_arenas.envs.arms.arm import HOME, Arm
from mjx_arenas.envs.arms.foot import Foot
from mjx_arenas.envs.base import ArenaEnv, Episode, RangesAt
from mjx_arenas.envs.config import chosen_config, env_config
from mjx_arenas.envs.tasks import defaults as defaults_
from mjx_arenas.envs.tasks import goals, looks
from mjx_arenas.envs.tasks.defaults import Defaults
from mjx_arenas.envs.vision import Vision
from mjx_arenas.keywords import check_known
from mjx_arenas.params.distributions import Choice, LogUniform, Uniform
from mjx_arenas.params.params import ArenaParams, ArenaRanges
from mjx_arenas.problem import problem
from mjx_arenas.rows import dot
from mjx_arenas.rules.validation import error, is_number, raise_all, vector_problems
from mjx_arenas.spec import names, specs

STEP = 0.025  # [m] that an action moves the tool at most, along each axis
TURN = 0.12  # [rad] that it turns it
JOINT_STEP = 0.08  # [rad] or [m] that an action moves a joint
MOST_SCALE = 10  # of a step
AHEAD = 0.4  # [rad] or [m] that a servo's target is ahead of its joint at most
BETWEEN = 0.02  # [m] from the tool to the middle of an object between the fingers; on top of it they are further away
UPRIGHT = 0.5  # of a tilt of the tool, which a step takes back
PREFIX = names.OF_TASKS
START = "arm_start"
"""The quantity by which joints start beside the keyframe, [rad] or [m]."""
MOUNT = (-0.3, 0.0, 0.0)  # [m] of an arm on a table of 0.9 m
EYE, LOOKS_AT = (0.85, 0.0, 0.7), (0.3, 0.0, 0.05)  # [m] of the camera, from the foot of the arm


def default_config(episode_length: int = 150) -> config_dict.ConfigDict:
    """Configuration of a task, with the keys of `env_config` and `ArmTask`, whose episodes have `episode_length` actions."""
    config = env_config(ctrl_dt=0.04, sim_dt=0.004, episode_length=episode_length)
    config.action, config.action_scale, config.keyframe, config.vision = "cartesian", 1.0, HOME, False
    config.update(flaws.NONE)
    return config


def training_ranges(**more: Any) -> ArenaRanges:
    """Ranges that all tasks of arms share, with further ones: they vary how the arm starts."""
    return ArenaRanges(terms={START: Uniform(-0.15, 0.15), **more.pop("terms", {})}, **more)


def wider_ranges(ranges: ArenaRanges, **more: Any) -> ArenaRanges:
    """The ranges of training, some of them replaced, with an arm that starts further from home."""
    return ranges._replace(terms={**ranges.terms, START: Uniform(-0.25, 0.25), **more.pop("terms", {})}, **more)


_FRICTION, _SLIPPERY = ([x, 0.005, 0.0001] for x in (0.4, 0.2))
BOXES: Mapping[str, Any] = {
    "table_frictions": LogUniform(_FRICTION, [1.2, 0.005, 0.0001]),
    "object_frictions": LogUniform(_FRICTION, [1.2, 0.005, 0.0001]),
    "object_full_sizes": Uniform(0.03, 0.06),
    "object_masses": LogUniform(0.03, 0.2),
}
"""The boxes of training, and on what they lie: with `TABLES_DECIDE` and `IN_GRIPS`, the friction of each counts."""
WIDER_BOXES: Mapping[str, Any] = {
    "table_frictions": LogUniform(_SLIPPERY, _FRICTION),
    "object_frictions": LogUniform(_SLIPPERY, _FRICTION),
    "object_masses": LogUniform(0.2, 0.4),
}
"""Ones that are both slippery and heavy."""
IN_GRIPS = 1
"""`priority` of an object whose friction counts between fingers; by MuJoCo's rule the larger one of both would."""
TABLES_DECIDE = 2
"""`table_priority` with which what stands on a table has the table's friction, an object with the priority `IN_GRIPS`, too."""
TABLE: Mapping[str, Any] = {
    "table_offsets": Uniform([-0.1, -0.1, -0.2], [0.1, 0.1, 0.2], relative="add"),
    "table_rots": Uniform(-0.6, 0.6),
    "table_full_sizes": Uniform([0.8, 0.8, 0.03], [1.0, 1.0, 0.08]),
}
"""The table of training, on which the arm stands."""
WIDER_TABLE: Mapping[str, Any] = {
    "table_offsets": Choice([[0, 0, -0.3], [0, 0, -0.25], [0, 0, 0.25], [0, 0, 0.3]], relative="add"),
    "table_rots": Uniform(0.7, 1.2),
}
"""Lower or higher, and turned further."""


def firm_grips(arena: Arena) -> Arena:
    """Gives an arena a cone of friction with which grips hold what they can, and C MuJoCo's contacts of boxes on Warp.

    By MuJoCo's defaults, a held box of 0.2 kg slips 4 mm a second, however hard the fingers press; an elliptic cone with `impratio` 10, as
    in Menagerie's grippers, makes this 0.2 mm. Of two boxes Warp finds other contacts than C, unless native collisions are switched off.
    """
    option = arena.spec.option
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    return arena


class Hand(NamedTuple):
    """An arm's own state, in the frame of its base."""

    q: jax.Array
    """(n,) of its joints [rad] or [m]."""
    velocity: jax.Array
    """(n,)"""
    grip: jax.Array
    """(f,) of its fingers' joints or tendons."""
    tool: chain.Tool


class Given(TypedDict, total=False):
    """Arguments that all tasks of arms take besides their configuration."""

    ranges: ArenaRanges | RangesAt | None
    arena: Arena | None
    arm: Arm | None
    on: int | str | None
    pos: Sequence[float]
    vision: Vision | None
    terms: Mapping[str, dr.Term] | None
    robot_strength: float


class ArmTask(ArenaEnv):
    """Base class of tasks for an arm whose gripper points down.

    Actions are within -1 and 1. With `config.action` "cartesian" there are five numbers:

    - Three are steps of the tool along x, y and z of the arm's base, of at most 2.5 cm.
    - One is a turn about the vertical, of at most 0.12 rad.
    - One is the grip: 1 is open, -1 is closed.

    Inverse kinematics keep the tool pointing down. With "joint" the numbers are steps of the joints, of at most 0.08 rad, and the grip. A
    step moves the targets of servos.

    The keys of `config` beside those of `env_config`, with their defaults, are

    - `action` ("cartesian"): what an action is, "cartesian" or "joint";
    - `action_scale` (1.0): a factor on the sizes of its steps;
    - `keyframe` ("home"): the arm's keyframe in which episodes start;
    - `vision` (False): whether the policy sees pictures;
    - `action_delay`, `observation_delay` ((0, 0)): least and most actions by which these come late, see `flaws.Flaws`; one number is both;
    - `action_noise`, `observation_noise` (0.0): standard deviations of the noise that is added to them.

    Args:
        defaults: those of the task (arena, ranges, place of the arm), used if no arena is given.
        config: configuration as from `default_config()`.
        config_overrides: dotted names and values.
        ranges: ranges of the arenas. None: those of the task; in an arena of your own nothing varies. The quantity "arm_start" is added to
            the joints with which an arm starts.
        arena: arena with its objects, not compiled yet. None: that of the task. `Place(near="arm_" + arm.base, distance=arm.reach)` of an
            object keeps it within reach.
        arm: the arm. None: `arms.small()`.
        on: the table, by index or name, or the surface or part of furniture that carries the arm. None: the arm stands in the world. If the
            argument is left out: the task's own place, or the world in an arena of your own.
        pos: (3,) place of the foot of the arm in that frame [m].
        vision: the pictures. None, and `config.vision` is true: those of two cameras, 64 by 64 pixels each, "policy" on the arm's base
            and "policy_wrist" on its hand. Cameras may be these and those of the arena.
        terms: terms by name, as for `arena.vary`, also of the arm, whose names have the prefix "arm_". `ranges` draws them.
        robot_strength: strength of the ranges of `dr.robot` for the arm, from 0 to 1, under the names "arm_mass", "arm_kp" and so on.
            `ranges` may replace these ranges, and `terms` these terms, by their names. The friction of its geoms stays, since that of
            objects counts in the tasks' arenas. 0: the arm is the same in all episodes.

    Raises:
        ValueError: a joint of the arm has no position servo, or more than one; a control of its fingers is not that of its gripper; the
            arena has no object, although the task needs one; a value of `config` is invalid; or as for `ArenaEnv` and `arena.attach`.
    """

    def __init__(
        self,
        defaults: Defaults,
        config: config_dict.ConfigDict,
        config_overrides: Mapping[str, Any] | None = None,
        **given: Unpack[Given],
    ) -> None:
        own_names = (name for name in inspect.signature(type(self)).parameters if name != "given")
        check_known(type(self).__name__, [*dict.fromkeys([*own_names, *Given.__annotations__])], given)
        defaults_.check(defaults)
        known.check_config(config)
        chosen: Any = chosen_config(config, config_overrides or {}, list(default_config()))
        _check(chosen)
        arm, arena = given.get("arm"), given.get("arena")
        arm, ranges, vision = known.small() if arm is None else arm, given.get("ranges"), given.get("vision")
        self._chain = moves.checked(arm)
        self._holds = bool(defaults.does) and defaults.grips
        if self._holds and not arm.fingers:
            raise error([problem("arm.fingers", "fingers_to", None, dict(arm.fingers), does=defaults.does)])
        moves.check_keyframe(arm, chosen.keyframe)
        usual = defaults if arena is None else defaults._replace(ranges=ArenaRanges, on=None, pos=(0.0, 0.0, 0.0))
        on, pos = given.get("on", usual.on), given.get("pos", usual.pos)
        raise_all(vector_problems("pos", pos, 3, "[m]"), "`pos`")
        x, y, z = pos
        arena, sees = defaults.arena(arm) if arena is None else arena, vision is not None or chosen.vision
        refusals.check_arena(arena, open_for="the arm")
        if defaults.does and not arena.objects:
            raise error([problem("arena", "an_object_to", None, None, does=defaults.does)])
        if sees:
            looks.check(arena, arm.spec, arm.tool)
        if ranges is None:
            ranges = looks.with_looks(usual.ranges(), len(arena.objects), wrist=True) if sees else usual.ranges()
        self._scale: float = chosen.action_scale
        arena.attach(arm.spec, prefix=PREFIX, pos=(x, y, z + arm.rise), on=on, keyframe=chosen.keyframe)
        defaults.marks(arena.spec)
        arena.vary(**{START: dr.Term("joint.qpos", [PREFIX + name for name in self._chain.joints])})
        ranges = dynamics.vary(arena, PREFIX, ranges, given.get("terms"), given.get("robot_strength", 0.0))
        if sees:
            vision = looks.default_vision(wrist=True) if vision is None else vision
            eye, at = (np.subtract(point, (0, 0, arm.rise)) for point in (EYE, LOOKS_AT))
            looks.add_camera(arena, eye.tolist(), at.tolist(), PREFIX + arm.base)
            wrist_camera.add(arena, specs.compiled(arm.spec, "arm.spec"), chosen.keyframe, arm.tool, PREFIX)
        if given.get("arena") is None and chosen.get("max_contacts") is None:
            chosen.update(max_contacts=defaults.max_contacts)
        super().__init__(arena, ranges, chosen, keyframe=PREFIX + chosen.keyframe, vision=vision)
        model, self.arm, base = self.arena.mj_model, arm, PREFIX + arm.base
        joints = [model.joint(PREFIX + name) for name in self._chain.joints]
        self._q, self._v = np.array([(joint.qposadr[0], joint.dofadr[0]) for joint in joints]).T
        self._servo = np.array([servos.on(model, joint.id)[0] for joint in joints])
        self._range = servos.targets(model, [joint.id for joint in joints], self._servo)
        self._grips = grips.grips(model, {PREFIX + name: controls for name, controls in arm.fingers.items()})
        self._base = model.body(base).id
        self._links = chain.varied(model, base, PREFIX + arm.tool, self.arena.record.scene.touched(self._varying))
        if self._holds:
            graspable.warn_of_cone(model.opt)
            graspable.warn_of_wide(arena, self._ranges_at(jnp.ones(())), arm.width)
        moved = moves.moves(arm, self._chain, chosen.keyframe) if defaults.does else None
        self._foot = None if moved is None else Foot.of(self.arena, base, arm, moved)
        self.flaws = flaws.of(chosen, self.neutral_action)

    def reset(self, rng: jax.Array) -> State:
        state = super().reset(rng)
        if self.flaws is None:
            return state
        late = self.flaws.start(state.obs)
        late, obs = self.flaws.see(late, state.obs, jnp.ones((), bool), state.info["episode"], state.info["step"])
        return state.replace(obs=obs, info={**state.info, "late": late})

    def step(self, state: State, action: jax.Array) -> State:
        if self.flaws is None:
            return super().step(state, action)
        refusals.check_step(state, action, self.action_size)
        begins, late, before = self.begins(state), state.info["late"], dict(state.obs)  # type: ignore[arg-type]
        taken = state.info["step"] * ~begins
        late, action = self.flaws.act(late, action, begins, state.info["episode"], taken)
        # Pictures that are not drawn anew stay those that were seen last, not those that are on their way.
        state = super().step(state.replace(obs=before | {name: x[0] for name, x in late.obs.items()}), action)
        late, obs = self.flaws.see(late, state.obs, begins, state.info["episode"], state.info["step"])
        return state.replace(obs=obs, info={**state.info, "late": late})

    @property
    def foot(self) -> Foot:
        """Where the arm stands, and what it reaches from there."""
        if self._foot is None:
            raise error([problem(f"{type(self).__name__}.foot", "needs_does")])
        return self._foot

    @property
    def action_size(self) -> int:
        """Number of actions: 5 for Cartesian actions; for joint actions the number of joints plus 1."""
        return 5 if self._config.action == "cartesian" else len(self._q) + 1

    @property
    def neutral_action(self) -> jax.Array:
        """(`action_size`,) no step, and the grip as the arm starts with it."""
        grip, mj_model = self._grips, self.arena.mj_model
        is_open = grips.opened(mj_model.key(self.keyframe).ctrl[grip.ids], grip.controls)
        return jnp.zeros(self.action_size).at[-1].set(np.clip(2 * is_open.mean() - 1, -1, 1) if len(is_open) else 0.0)

    @property
    def arm_joints(self) -> tuple[str, ...]:
        """Names of the joints from the arm's base to its tool."""
        return tuple(PREFIX + name for name in self._chain.joints)

    @property
    def finger_joints(self) -> tuple[str, ...]:
        """Names of the joints, or of the tendons, that its gripper's actuators move."""
        return self._grips.names

    def drive(self, data: mjx.Data, episode: Episode, action: jax.Array) -> jax.Array:
        """As of `ArenaEnv`. Inverse kinematics are those of the nominal arm, also where links vary, as a real controller knows no other."""
        refusals.check_drive(self, ArmTask)
        q, scale = data.qpos[self._q], self._scale
        before = jnp.where(data.time == 0, q, data.ctrl[self._servo])  # an arm stays where it starts
        if self._config.action == "joint":
            change = scale * JOINT_STEP * action[:-1]
        else:
            at = chain.tool(self._chain, before)
            tilt = jnp.cross(at.mat[:, 2], jnp.array([0.0, 0.0, -1.0]))
            about = UPRIGHT * tilt + jnp.array([0.0, 0.0, scale * TURN]) * action[3]
            change = chain.steps(at.jacobian, jnp.concatenate([scale * STEP * action[:3], about]))
        target = jnp.clip(
            before + change, jnp.maximum(self._range[0], q - AHEAD), jnp.minimum(self._range[1], q + AHEAD)
        )
        closed, opened = self._grips.controls
        grip = closed + (opened - closed) * (action[-1] + 1) / 2
        return data.ctrl.at[self._servo].set(target).at[self._grips.ids].set(grip)

    def hand(self, data: mjx.Data, episode: Episode | None = None) -> Hand:
        """The arm's own state: joints, velocities, fingers and tool.

        The tool is where the joints have it now. What MJX has computed of sites is from before the last step of the physics, and nothing
        is computed for a start.

        Args:
            data: of the world.
            episode: of the world, whose arm may have links, joints or a tool of its own. An arm that does not vary so needs none.

        Raises:
            ValueError: there is no `episode`, and the arm does vary so.
        """
        q, arm = data.qpos[self._q], self._chain
        if self._links is not None:
            if episode is None:
                raise error([problem("episode", "episode_of_links")])
            arm = self._links.chain(episode.fields)
        return Hand(q, data.qvel[self._v], grips.position(self._grips, data.qpos), chain.tool(arm, q))

    def local(self, data: mjx.Data, pos: jax.Array) -> jax.Array:
        """(3,) position of a point of the world in the frame of the arm's base [m]."""
        return self.local_vector(data, pos - data.xpos[self._base])

    def local_vector(self, data: mjx.Data, vector: jax.Array) -> jax.Array:
        """(3,) a vector of the world in the axes of the arm's base."""
        return dot("ki,k->i", data.xmat[self._base], vector)

    def middle(self, params: ArenaParams, qpos: jax.Array) -> jax.Array:
        """(3,) middle of the first object where it is at `qpos` (nq,), in the world [m]; its origin may be elsewhere."""
        if not self.arena.objects:
            raise error([problem(f"{type(self).__name__}.middle", "needs_does")])
        return goals.middle(self.arena, params, qpos)

    def thing(self, data: mjx.Data, episode: Episode) -> tuple[jax.Array, jax.Array]:
        """(3,) position of the middle [m] and (3, 3) orientation of the first object in the frame of the arm's base."""
        quat = quaternions.normalize(data.qpos[self.arena.layout.object_qpos[0, 3:]])
        pos = self.local(data, self.middle(episode.params, data.qpos))
        return pos, dot("ki,kj->ij", data.xmat[self._base], quaternions.quat_to_mat(quat))

    def takes(self, params: ArenaParams, qpos: jax.Array, lift: float = 0.0) -> jax.Array:
        """() bool: the arm reaches the first object where it is at `qpos` (nq,), and `lift` [m] above, and takes it if it must."""
        place = self.middle(params, qpos)
        beyond = self.foot.beyond(params, jnp.stack([place, place.at[2].add(lift)])).max()
        reached = beyond <= graspable.SLACK
        return reached & graspable.taken(self.arena, params, self.arm.width) if self._holds else reached

    def thing_velocity(self, data: mjx.Data, episode: Episode) -> jax.Array:
        """(3,) velocity of the middle of the first object in the axes of the arm's base [m/s]."""
        return self.local_vector(data, goals.middle_velocity(self.arena, episode.params, data))

    def proprioception(self, data: mjx.Data, episode: Episode | None = None) -> jax.Array:
        """(3n + 2f + 5,) the arm's knowledge of itself: see docs/arms.md. `episode` as for `hand`."""
        hand, grip = self.hand(data, episode), self._grips
        tool, ctrl = hand.tool, data.ctrl
        is_open, told = grips.opened(hand.grip, grip.ends), grips.opened(ctrl[grip.ids], grip.controls)
        ahead = [ctrl[self._servo] - hand.q, told - is_open]
        return jnp.concatenate([hand.q, 0.1 * hand.velocity, is_open, *ahead, tool.pos, tool.mat[:2, 0]])


def _check(config: Any) -> None:
    """Raises where what a configuration says of actions makes no sense."""
    if config.action not in ("cartesian", "joint"):
        raise error([problem("config.action", "must", None, config.action, must="'cartesian' or 'joint'")])
    if not (is_number(config.action_scale) and 0 < config.action_scale <= MOST_SCALE):
        must = f"a number > 0 and <= {MOST_SCALE}, with which a step is {MOST_SCALE * STEP} m"
        raise error([problem("config.action_scale", "must", None, config.action_scale, must=must)])


def gripped(distance: jax.Array, action: jax.Array) -> jax.Array:
    """() from 0 to 1, how far the grip is told to close around an object whose middle is at a `distance` [m] from the tool."""
    return jnp.maximum(1 - distance / BETWEEN, 0.0) * (1 - action[-1]) / 2


def thing_numbers(params: ArenaParams) -> list[jax.Array]:
    """Size [dm], mass and friction of the first object, for a critic; 5 numbers."""
    return [10 * params.object_full_sizes[0], params.object_masses[:1], params.object_frictions[0, :1]]
