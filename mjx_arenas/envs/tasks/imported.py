"""Tasks and arms of a user's own, which a configuration names by "module:function" (host)."""

import inspect
import pkgutil
import traceback
from collections.abc import Callable, Collection, Mapping
from typing import Any

import jax

from mjx_arenas.envs.arms.arm import Arm
from mjx_arenas.envs.base import ArenaEnv
from mjx_arenas.keywords import nearest
from mjx_arenas.problem import Told, problem
from mjx_arenas.problems.messages import error, problems_of

_OF_CONFIGURATION = ("config_overrides", "ranges", "vision", "arena")
"""Arguments that a configuration gives under other names, or as files."""


def arm(name: str) -> Arm:
    """What a function without arguments makes.

    Raises:
        ValueError: it cannot be imported, needs arguments, fails, or makes no arm.
    """
    made = _call("env.arm", name, {})
    if not isinstance(made, Arm):
        raise error([problem("env.arm", "makes", None, name, must="an Arm", made=_a(made))])
    return made


def environment(name: str, arguments: Mapping[str, Any]) -> ArenaEnv:
    """What a class or a function makes of arguments, `config_overrides` among them.

    Raises:
        ValueError: it cannot be imported, does not take the arguments, fails, or makes no `ArenaEnv`.
    """
    _check_takes(name, arguments)
    made = _call("task", name, arguments)
    if not isinstance(made, ArenaEnv):
        raise error([problem("task", "makes", None, name, must="an ArenaEnv", made=_a(made))])
    return made


def _check_takes(name: str, arguments: Collection[str]) -> None:
    """Refuses a class or a function that does not take some arguments; what may be given in `env` is told by other words than the rest."""
    known = _arguments(_function("task", name))
    if known is None:
        return
    for needed in (n for n in _OF_CONFIGURATION if n in arguments and n not in known):
        takes = ", ".join(known) or "no arguments"
        raise error([problem("task", "task_takes", None, name, needed=needed, takes=takes)])
    own = [n for n in known if n not in (*_OF_CONFIGURATION, "config")]
    check_env(name, [n for n in arguments if n not in _OF_CONFIGURATION], ["config", *own])


def check_env(name: str, given: Collection[str], takes: Collection[str]) -> None:
    """Refuses names in `env` of a configuration that its task does not take."""
    if unknown := [n for n in given if n not in takes]:
        close = nearest(unknown[0], takes)
        told = {"task": name, "takes": ", ".join(takes), "close": close}
        raise error([problem("env", "env_meant" if close else "env_of_task", None, Told(", ".join(unknown)), told)])


def check_observations(env: ArenaEnv) -> None:
    """Refuses an environment that does not give what the networks of policy and critic take."""
    seen = jax.eval_shape(env.reset, jax.random.key(0)).obs
    names = [*seen] if isinstance(seen, Mapping) else None
    if names is None or not {"state", "privileged_state"} <= {*names}:
        got = "one array" if names is None else ", ".join(map(repr, names))
        raise error([problem("task", "gives", None, Told(got), must="observations 'state' and 'privileged_state'")])


def _function(argument: str, name: str) -> Callable[..., Any]:
    """What an argument of a configuration names."""
    try:
        found = pkgutil.resolve_name(name)
    except (ImportError, AttributeError, ValueError) as refused:
        of = getattr(refused, "obj", None)  # of an AttributeError
        names = [n for n in dir(of) if not n.startswith("_")] if inspect.ismodule(of) else []
        close = nearest(name.rpartition(":")[2], names)
        rule = "importable_meant" if close else "importable"
        raise error([problem(argument, rule, None, name, why=refused, close=close)]) from None
    if not callable(found):
        raise error([problem(argument, "function", None, name, kind=_a(found))])
    return found


def _call(argument: str, name: str, given: Mapping[str, Any]) -> Any:
    """What it makes; says where in the user's own code it fails in a way that no sentence tells."""
    make = _function(argument, name)
    try:
        inspect.signature(make).bind(**given)
    except TypeError:
        must = f"something to call with {', '.join(given)}" if given else "a function that needs no arguments"
        raise error([problem(argument, "must", None, name, must=must)]) from None
    try:
        return make(**given)
    except (OSError, ImportError):
        raise
    except Exception as caught:
        if isinstance(caught, ValueError) and problems_of(caught)[0].rule != "said":
            raise
        last = traceback.extract_tb(caught.__traceback__)[-1]
        told = {"kind": type(caught).__name__, "why": caught, "file": last.filename, "line": last.lineno}
        raise error([problem(argument, "fails", None, name, told)]) from caught


def _arguments(make: Callable[..., Any]) -> list[str] | None:
    """Names of a function's arguments; None: any."""
    known = inspect.signature(make).parameters
    return None if any(p.kind is p.VAR_KEYWORD for p in known.values()) else [*known]


def _a(thing: Any) -> str:
    kind = type(thing).__name__
    return f"{'an' if kind[0].lower() in 'aeiou' else 'a'} {kind}"
