"""Problems in words: the one place where sentences are made, and raised all in one error (host)."""

import dataclasses
import json
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.params import DENSITIES, QUANTITIES, Quantity
from mjx_arenas.problem import Item, Problem
from mjx_arenas.problems.sentences import SENTENCES

LISTED = 30  # problems in one error
_INSIDE = ("mjx_arenas", "jax", "functools")  # no user's code; cached properties are in `functools`


class Words(NamedTuple):
    """What Python's constants are called, and how one says that an argument may be missing."""

    none: str
    true: str
    false: str
    or_none: str


PYTHON = Words("None", "True", "False", ", or None")
FILE = Words("null", "true", "false", ", or left out")


def raise_all(problems: Iterable[Problem], where: str) -> None:
    """Raises one `ValueError` with all problems, if there are any."""
    problems = list(problems)
    if problems:
        raise error(problems, where)


def error(problems: Sequence[Problem], where: str = "", kind: type[Exception] = ValueError) -> Exception:
    """The error that says all problems, a sentence each, and carries them as data (`problems_of`)."""
    sentences = list(dict.fromkeys(map(sentence, problems)))
    text = sentences[0]
    if len(sentences) > 1:
        more = [f"and {len(sentences) - LISTED} more"] if len(sentences) > LISTED else []
        listed = "\n".join(f"- {s}" for s in [*sentences[:LISTED], *more])
        text = f"{len(sentences)} problems in {where}:\n{listed}"
    made = kind(text)
    made.__dict__["problems"] = tuple(problems)
    return made


def warn(problem: Problem) -> None:
    """Warns of what is no error, at the user's line."""
    made = UserWarning(sentence(problem))
    made.__dict__["problems"] = (problem,)
    warnings.warn(made, stacklevel=outside())


def outside() -> int:
    """The `stacklevel` with which who asks warns at the user's line: the first that is in none of `_INSIDE`."""
    frame, level = sys._getframe(1), 1
    while frame is not None and frame.f_globals.get("__name__", "").partition(".")[0] in _INSIDE:
        frame, level = frame.f_back, level + 1
    return level


def problems_of(error: BaseException) -> tuple[Problem, ...]:
    """The problems that an error or a warning carries; of one that carries none, its text."""
    return error.__dict__.get("problems") or (Problem("", "said", numbers={"text": str(error)}),)


def sentence(problem: Problem) -> str:
    """A problem in words."""
    words = PYTHON if problem.source is None else FILE
    fields: dict[str, Any] = {
        "path": problem.path,
        "at": subject(problem),
        "owner": _owner(problem),
        "label": label(problem.item),
    }
    fields["Label"] = fields["label"][:1].upper() + fields["label"][1:]
    fields |= {
        "got": show(problem.got, words),
        "got_shape": _shape(problem.got),
        "or_none": "",
        "later": "",
        "near": "",
    }
    fields |= dict(problem.numbers)
    if "quantity" in fields:
        given = fields["quantity"]
        quantity = given if isinstance(given, Quantity) else QUANTITIES.get(given, DENSITIES)
        fields = {
            "must": quantity.must,
            "finite": " and" * (quantity.allowed is not None),
            "between": quantity.between,
        } | fields
        fields["one"] = f"({quantity.axes})" if quantity.item else "one value"
    if fields.pop("optional", False):
        fields["or_none"] = words.or_none
    for name, in_words in _IN_WORDS.items():
        if name in fields:
            fields[name] = in_words(fields[name])
    text = SENTENCES[problem.rule].format(**fields)
    if problem.world is not None:
        text = f"World {problem.world}: {text}"
    return text if problem.source is None else _in_a_file(problem, text)


def _in_a_file(problem: Problem, text: str) -> str:
    source = problem.source
    assert source is not None
    line = f":{source.line}" if source.line else ""
    return f"{source.file}{line}: " + (f"`{source.node}`: " if source.node else "") + text


def subject(problem: Problem) -> str:
    """The argument with the table, object or distribution that a sentence is about."""
    path, item = problem.path, problem.item
    if path == "objects" or path.startswith("objects."):
        field = path.removeprefix("objects").removeprefix(".")
        if item is not None and item[0] == "object":
            return _owner(problem) + (f": `{field}`" if field else "")
    if path.startswith("part.") and item is not None and item[0] == "part":
        return f"Part {item[1]!r}: `{path.removeprefix('part.')}`"
    if path.startswith(("ranges.", "rules.")) and "dist" in problem.numbers:
        whole, _, rest = path.partition(".")
        quantity, field = _split(rest)
        kind = f" ({problem.numbers['dist']})" if problem.numbers["dist"] else ""
        head = f"`{whole}.{quantity}`{kind}" + (f" of {label(item)}" if item else "")
        return f"{head}: `{field}`" if field else head
    return f"`{path}`" + (f" of {label(item)}" if item and item[0] != "entry" else "")


def _split(path: str) -> tuple[str, str]:
    """A quantity and what of its distribution a path is about, if that is said; names of furniture's quantities have dots."""
    if not path.startswith("terms."):
        quantity, _, field = path.partition(".")
        return quantity, field
    quantity, _, last = path.rpartition(".")
    kinds: list[Any] = Distribution.__subclasses__()
    known = {field.name for kind in kinds for field in dataclasses.fields(kind)}
    return (quantity, last) if last in known and quantity != "terms" else (path, "")


def _owner(problem: Problem) -> str:
    """Whose argument it is: an object, or that of the call itself."""
    item = problem.item
    return f"Object {item[1]!r}" if item and item[0] == "object" else f"`{problem.path}`"


def label(item: Item | None) -> str:
    """What sentences call a table, an object, two tables or all."""
    if item is None:
        return ""
    kind, which = item
    if which is None:
        return f"all {kind[:-1]}ies" if kind.endswith("y") else f"all {kind}s"
    if kind == "tables":
        return f"tables {which[0]} and {which[1]}"
    return f"{kind} {which!r}"


def names_path(rule: str) -> bool:
    """Whether the sentence of a rule names the argument."""
    return any(field in SENTENCES[rule] for field in ("{at}", "{owner}", "`{path}`"))


def show(value: object, words: Words = PYTHON) -> str:
    """A value, arrays as the numbers in them; where it takes more than a line, what it is."""
    text = _shown(value, words)
    if len(text) <= 200 and "\n" not in text:
        return text
    if isinstance(value, (list, tuple, str, np.ndarray)):
        return f"{text[:100]} ..."
    return type(value).__name__


def kind_of(value: object) -> str:
    """What a value is: its type; of what JAX traces, that of its numbers, and its shape."""
    if isinstance(value, jax.core.Tracer):
        return f"{value.dtype} of shape {value.shape}" if value.shape else f"{value.dtype}"
    return type(value).__name__


def _shown(value: object, words: Words) -> str:
    if isinstance(value, jax.core.Tracer):
        return kind_of(value)
    is_array = isinstance(value, (np.ndarray, np.generic, jax.Array))
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jax.dtypes.prng_key):
        return "a key" if not value.shape else f"keys of shape {value.shape}"
    if is_array and getattr(value.dtype, "kind", "") in ("b", "i", "u", "f", "U", "S"):  # type: ignore[union-attr]
        value = np.asarray(value).tolist()
    if type(value) in (list, tuple):
        inner = ", ".join(_shown(item, words) for item in value)  # type: ignore[union-attr]
        if isinstance(value, list):
            return f"[{inner}]"
        return f"({inner},)" if len(value) == 1 else f"({inner})"  # type: ignore[arg-type]
    constants = {None: words.none, True: words.true, False: words.false}
    if value is None or isinstance(value, bool):
        return constants[value]
    text = repr(value)
    if isinstance(value, str) or " at 0x" not in text:
        return text
    return str(getattr(value, "__name__", type(value).__name__))


def _shape(value: object) -> str:
    try:
        shape = np.shape(value)  # type: ignore[arg-type]
    except (ValueError, TypeError):  # NumPy takes no keys
        return "lists of different lengths" if isinstance(value, (list, tuple)) else kind_of(value)
    return f"shape {shape}" if shape else "one number"


def known_tables(names: Sequence[str]) -> str:
    """What may be given as a table."""
    if len(names) == 1:
        return f"0 or {names[0]!r}"
    return f"an index from 0 to {len(names) - 1} or one of {', '.join(map(repr, names))}"


def by(lengths: Sequence[float] | np.ndarray) -> str:
    """Extents as one says them."""
    return " x ".join(f"{x:g}" for x in lengths)


def _wanted(shape: Sequence[int | str] | None) -> str:
    if shape is None:
        return "None"
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


def _nearest(names: tuple[str | None, Sequence[str]]) -> str:
    close, known = names
    return f": did you mean `{close}`?" if close else f"; known are {', '.join(known) or 'none'}."


def _json(node: object) -> str:
    text = repr(node) if isinstance(node, str) else json.dumps(node, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


_IN_WORDS: dict[str, Callable[[Any], str]] = {
    "tables": known_tables,
    "n_tables": lambda n: "each table" if n is None else f"each of the {n} tables",
    "size": by,
    "top": by,
    "nearest": _nearest,
    "json": _json,
    "want": _wanted,
    "shape": _wanted,
    "low": show,
    "high": show,
    "names": _listed,
    "unit": lambda unit: f" {unit}" if unit else "",
}
