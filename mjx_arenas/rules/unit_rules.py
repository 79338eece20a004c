"""Numbers that are possible, and almost surely in another unit than they should be (host)."""

import numpy as np

from mjx_arenas.params.params import Quantity
from mjx_arenas.problem import Item, problem
from mjx_arenas.problems.messages import warn

NARROW = 3.0  # [degrees] below which angles are rather radians: 3 rad are 172 degrees
LONG = 0.1  # [s] above which time steps are rather milliseconds
TIMES = 100  # as large as it is nominally: what was measured in centimetres, or weighed in grams
DENSEST = 23_000  # [kg/m^3] more than osmium has: what was weighed in grams
LONGEST = 10  # [m] of a table, a board, a cabinet or a drawer: what was measured in centimetres
FAR = 100  # [m] from the middle of the world, beyond which places are rather millimetres


def narrow(angles: float) -> dict[str, float]:
    """What is said of angles that are so large at most [degrees], if they look like radians."""
    return {"most": angles, "degrees": float(np.degrees(angles))} if angles < NARROW else {}


def warn_of_radians(name: str, angle: float, item: Item | None = None) -> None:
    """Warns of an angle [degrees] that looks like one in radians."""
    if told := narrow(angle):
        warn(problem(name, "radians", item, None, told))


def other_unit(
    quantity: Quantity, low: np.ndarray, high: np.ndarray, nominal: np.ndarray, decided: np.ndarray
) -> tuple[str, tuple[int, ...], dict[str, float]] | None:
    """A number whose absolute range looks as if it were in another unit, and whose nominal number does not.

    Args:
        quantity: whose they are.
        low: the smallest numbers that the range gives (N, ...).
        high: the largest ones.
        nominal: those of the arena.
        decided: which of them the range decides.

    Returns:
        The rule of its sentence, its place, and what the sentence says; None if there is none.
    """
    if quantity.unit == "[degrees]":
        found = decided & (high < NARROW) & (nominal >= NARROW)
        at = _first(found, -high)
        return ("radians", at, narrow(float(high[at]))) if found.any() else None
    if quantity.of == "option" and quantity.unit == "[s]":
        found = decided & (high > LONG) & (nominal <= LONG)
        at = _first(found, high)
        return ("milliseconds", at, {"most": high[at]}) if found.any() else None
    lengths = quantity.unit.startswith("[m]")
    if lengths and quantity.allowed is None:
        away = np.maximum(np.abs(low), np.abs(high))
        found = decided & (away > FAR) & (np.abs(nominal) <= FAR)
        at = _first(found, away)
        return ("millimetres", at, {"most": away[at]}) if found.any() else None
    if not lengths and quantity.unit != "[kg]":
        return None
    times = np.where(decided & (nominal > 0), high / np.where(nominal > 0, nominal, 1), 0)
    at = _first(times > TIMES, times)
    told = {"most": high[at], "times": times[at], "nominal": nominal[at]}
    return ("centimetres" if lengths else "grams", at, told) if times[at] > TIMES else None


def _first(found: np.ndarray, by: np.ndarray) -> tuple[int, ...]:
    """The place of the one that is most."""
    return tuple(map(int, np.unravel_index(np.where(found, by, -np.inf).argmax(), found.shape)))
