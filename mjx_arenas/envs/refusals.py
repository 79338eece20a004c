"""Answers to what a task of a user's own gets wrong, while it is made and while it is traced (host)."""

import inspect
import pickle
import random
import types
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco import mjx
from mujoco_playground import State

from mjx_arenas.arena import Arena
from mjx_arenas.keywords import quoted
from mjx_arenas.params.params import ArenaRanges
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error, raise_all, warn
from mjx_arenas.rules import validation_ranges
from mjx_arenas.rules.validation import check_takes, check_type, kind_of

_METHODS = {
    "draw_task": ("key", "params", "qpos"),
    "observe": ("data", "episode"),
    "score": ("data", "episode", "action"),
    "mark": ("data", "episode"),
    "control": ("action",),
    "drive": ("data", "episode", "action"),
}
"""What of a task a user may define, and what each is given."""
_OWN = ("draw_task", "observe", "score")
"""Which of these a task must define."""
_TRACED = (
    jax.errors.ConcretizationTypeError,
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
)
"""Errors of what needs to know a traced number."""


class _OfInit:
    """Stands in a class for an attribute that `ArenaEnv.__init__` sets, and is asked only until then."""

    def __get__(self, env: Any, kind: type) -> Any:
        if env is None:
            return self
        raise error([problem(f"{kind.__name__}.__init__", "init_of_env")], kind=AttributeError)


def of_init() -> Any:
    """What stands in a class for an attribute that `ArenaEnv.__init__` sets."""
    return _OfInit()


def check_arena(arena: Any, open_for: str = "") -> None:
    """Refuses what is no arena, and says what to do with a name or with what `load` gives; with `open_for` also one that is closed."""
    must = "an arena such as mjx_arenas.TableArena()"
    if isinstance(arena, (str, tuple)):
        must += ", or the first of the two that mjx_arenas.load(...) gives"
    check_type("arena", arena, Arena, must)
    if open_for and arena.is_compiled:
        raise error([problem("arena", "arena_taken", what=open_for)])


def check_timestep(arena: Arena, sim_dt: float) -> None:
    """Raises where worlds would have steps of other lengths than the environment."""
    for name in (term.name for term in arena.drawing.terms if term.attribute == "option.timestep"):
        raise error([problem("arena", "varied_timestep", None, None, name=name)])
    if arena.is_compiled and arena.mj_model.opt.timestep != sim_dt:
        told = Told(f"{arena.mj_model.opt.timestep:g}")
        raise error([problem("arena", "compiled_timestep", None, told, wanted=sim_dt)])


def check_object_there(arena: Arena, levels: Sequence[ArenaRanges]) -> None:
    """Refuses a task whose object, the first, is there in no world of the ranges, at any of the levels."""
    if any(validation_ranges.presence(at, arena.drawing, most=True)[1][0] for at in levels):
        return
    name, dist, active = arena.objects[0].name, levels[-1].object_active, arena.drawing.params.object_active
    item, why = ("object", name), "as the task is about it"
    if dist is None and not active[0]:
        raise error([problem("objects.active", "must", item, False, must=f"true, or vary (`object_active`), {why}")])
    if dist is not None and not validation_ranges.reach(dist, np.asarray(active))[1][0]:
        raise error([problem("ranges.object_active", "must", item, dist, must=f"true in some world, {why}", dist="")])
    on = validation_ranges.presence(levels[-1], arena.drawing, most=True)[3][0]
    must = f"a world with something on which object {name!r} can stand, {why}"
    got = f"none with {' or '.join(repr(arena.surfaces[i]) for i in on)}"
    path = "ranges" if levels[-1].varying else "arena"
    raise error([problem(path, "has", None, Told(got), must=must)])


def check_goals_there(arena: Arena, levels: Sequence[ArenaRanges], goals: Sequence[int], given: bool) -> None:
    """Refuses goals, given or the task's default, of which none is there in any world in which the first object stands on another."""
    for at in levels:
        _, _, below, on = validation_ranges.presence(at, arena.drawing, most=True)
        if any(below[goal] and any(below[i] for i in on[0] if i != goal) for goal in goals):
            return
    must = f"a surface that is there in some world while object {arena.objects[0].name!r} stands on another"
    names = [arena.surfaces[i] for i in goals]
    got = names if given else Told(f"none, which stands for the second surface, {names[0]!r}")
    raise error([problem("goals", "must", None, got, must=must)])


def check_surface_there(arena: Arena, levels: Sequence[ArenaRanges], path: str, name: str, index: int) -> None:
    """Refuses a part of furniture one of whose surfaces, with its index, is there in no world."""
    if not any(validation_ranges.presence(at, arena.drawing, most=True)[2][index] for at in levels):
        raise error([problem(path, "must", None, name, must="a part of the arena that is there in some world")])


def warn_of_falling(arena: Arena) -> None:
    """Warns of objects that still fall when an episode starts."""
    names = [repr(o.name) for o, drops in zip(arena.objects, arena.layout.places.drop, strict=True) if drops]
    if names:
        warn(problem("arena", "falling", names=names))


def check_methods(env: Any, base: type) -> None:
    """Raises where a task lacks a method that `base` leaves to it, or has one that takes other arguments than it is given."""
    if missing := [name for name in _OWN if getattr(type(env), name) is getattr(base, name)]:
        raise error([problem(type(env).__name__, "methods", names=[quoted(missing)])], kind=TypeError)
    for name, arguments in _METHODS.items():
        check_takes(f"{type(env).__name__}.{name}", getattr(env, name), arguments)


def asked(method: types.MethodType, *arguments: Any) -> Any:
    """What a method of a task gives for traced arguments. A warning says if it draws numbers with `np.random` or `random`.

    Raises:
        TypeError: it treats a traced number as if it were known, in an `if`, `float(...)` or NumPy.
    """
    called = f"{type(method.__self__).__name__}.{method.__name__}"
    before = drawn_on_host()
    try:
        given = method(*arguments)
    except _TRACED as refused:
        raise error([problem(called, "traced")], kind=TypeError) from refused
    if drawn_on_host() != before:  # or another thread drew meanwhile, so it is no error
        warn(problem(called, "drawn_on_host"))
    return given


def drawn_on_host() -> bytes:
    """What changes where numbers are drawn with `np.random` or `random`."""
    return pickle.dumps((np.random.get_state(legacy=False), random.getstate()))


def felt(env: Any, data: mjx.Data, episode: Any) -> jax.Array:
    """(n,) what a task's `proprioception` gives, which may take the episode, too."""
    takes = "episode" in inspect.signature(env.proprioception).parameters
    return env.proprioception(data, episode) if takes else env.proprioception(data)


def check_score(method: str, given: Any, reserved: Collection[str]) -> None:
    """Raises where a task's `score`, by its full name `method`, does not give what `ArenaEnv.score` says."""
    if not isinstance(given, tuple) or len(given) != 3:
        got = f"{len(given)} things" if isinstance(given, tuple) else f"one {kind_of(given)}"
        raise error([problem(method, "gives", None, Told(got), must="a reward, whether the episode ends, and metrics")])
    for what, value in (("one number as reward", given[0]), ("one bool for whether the episode ends", given[1])):
        if isinstance(value, Mapping) or value is None:
            raise error([problem(method, "gives", None, Told(type(value).__name__), must=what)])
    (reward, ends), metrics = map(jnp.asarray, given[:2]), given[2]
    problems = []
    if reward.shape:
        problems.append(problem(method, "score_reward", None, reward))
    if ends.shape or ends.dtype != bool:
        problems.append(problem(method, "score_end", kind=_array(ends)))
    if not isinstance(metrics, Mapping):
        problems.append(problem(method, "score_metrics", kind=kind_of(metrics)))
        metrics = {"success": 0.0}
    if "success" not in metrics:
        problems.append(problem(method, "score_success", known=quoted(list(metrics)) or "none"))
    for name, value in metrics.items():
        if jnp.shape(value):
            problems.append(problem(method, "score_metric", ("entry", name), value, name=name))
        if name in reserved:
            problems.append(problem(method, "score_reserved", ("entry", name), name=name))
    raise_all(problems, f"`{method}`")


def check_observation(method: str, given: Any, sees: bool = False) -> None:
    """Raises where a task's `observe` gives nothing that policies take; one that `sees` pictures takes its `state` from elsewhere."""
    if isinstance(given, Mapping) and "state" not in given and not sees:
        got = quoted(list(given)) or "none"
        raise error([problem(method, "gives", None, Told(got), must="'state' among its observations")])
    for name, value in given.items() if isinstance(given, Mapping) else ():
        if (
            not isinstance(value, jax.Array)
            or not value.ndim
            or not value.size
            or not jnp.issubdtype(value.dtype, jnp.floating)
        ):
            got = _array(value) if isinstance(value, jax.Array) else kind_of(value)
            raise error([problem(method, "gives", None, Told(got), must=f"numbers (n,) as {name!r}")])
    if not isinstance(given, (Mapping, jax.Array)):
        must = "a dict of arrays, 'state' and 'privileged_state', or one array"
        raise error([problem(method, "gives", None, Told(type(given).__name__), must=must)])


def check_privileged(method: str, given: Any) -> None:
    """Raises where a task's `observe` has nothing for the critic of a policy that sees pictures."""
    if not isinstance(given, Mapping) or "privileged_state" not in given:
        got = quoted(list(given)) if isinstance(given, Mapping) else "one array"
        raise error([problem(method, "gives", None, Told(got), must="a dict with 'privileged_state' for `vision`")])


def check_step(state: Any, action: Any, size: int) -> None:
    """Raises where a state is none, or is of many worlds, or an action is no array, has another size, or is of many worlds."""
    check_type("state", state, State, "a State, as reset and step give it")
    if jnp.ndim(state.done):
        raise error([problem("state", "one_world", of=f"{len(state.done)} worlds", instead="use jax.vmap")])
    check_type("action", action, (jax.Array, np.ndarray), f"an array ({size},)")
    if jnp.shape(action) != (size,):
        shape = jnp.shape(action)
        if len(shape) == 1:
            raise error([problem("action", "n_actions", None, len(action), n=size, s="s" * (size != 1))])
        told = {"of": f"shape {shape} instead of ({size},)", "instead": "use jax.vmap"}
        raise error([problem("action", "one_world", None, None, told)])


def check_alike(drawn: Any, given: Any) -> None:
    """Raises where what a state has of its next episode is not like what the environment draws."""
    if jax.tree.map(jnp.shape, drawn) != jax.tree.map(jnp.shape, given):
        raise error([problem("state", "state_of_another")])


def check_task(method: str, task: Any) -> None:
    """Raises where what a task draws is no tree of arrays, or its `possible` no single bool."""
    wrong = [
        leaf for leaf in jax.tree.leaves(task) if not isinstance(leaf, (jax.Array, np.ndarray, np.generic, int, float))
    ]
    if wrong:
        raise error([problem(method, "tree_of_arrays", None, Told(type(wrong[0]).__name__))])
    if isinstance(task, Mapping) and "possible" in task:
        must = "`possible` as an attribute, such as a field of a NamedTuple"
        raise error([problem(method, "gives", None, Told("a dict with it"), must=must)])
    possible = jnp.asarray(getattr(task, "possible", True))
    if possible.shape or possible.dtype != bool:
        raise error([problem(method, "gives", None, Told(_array(possible)), must="one bool as `possible`")])


def marked(env: Any, data: mjx.Data, episode: Any) -> mjx.Data:
    """The data with the task's marker in place, as its `mark` gives it."""
    found = asked(env.mark, data, episode)
    check_type(f"{type(env).__name__}.mark", found, mjx.Data, "a function that returns the data")
    return found


def check_default_control(method: str, shape: tuple[int, ...], mj_model: mujoco.MjModel) -> None:
    """Raises where actions of a shape cannot be mapped to the ranges of the actuators."""
    if shape != (mj_model.nu,):
        raise error([problem(method, "control_defined", None, shape, n=mj_model.nu)])
    for i in range(mj_model.nu):
        if not mj_model.actuator_ctrllimited[i]:
            name = mj_model.actuator(i).name or i
            raise error([problem(method, "control_unlimited", None, name)])


def check_drive(env: Any, base: Any) -> None:
    """Raises where a task has other actions than its `base`, and leaves it to the base to drive by them."""
    if type(env).action_size is not base.action_size and type(env).drive is base.drive:
        raise error([problem(f"{type(env).__name__}.drive", "drive_defined")])


def check_control(env: Any, base: Any, control: Any) -> None:
    """Raises where a task's `drive`, or the `control` in it, has another size than the actuators."""
    n = env.arena.mj_model.nu
    if jnp.shape(control) != (n,):
        method = "control" if type(env).drive is base.drive else "drive"
        must, got = f"({n},), a number for each actuator", Told(f"shape {jnp.shape(control)}")
        raise error([problem(f"{type(env).__name__}.{method}", "gives", None, got, must=must)])


def _array(value: Any) -> str:
    return f"{value.dtype} of shape {value.shape}" if value.shape else f"{value.dtype}"
