"""The numbers that make one arena, and the ranges they are drawn from.

T tables, K objects. One world at a time: `jax.vmap` adds the batch.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from mjx_arenas import keywords
from mjx_arenas.geometry import Array, array_module
from mjx_arenas.params.distribution import Distribution
from mjx_arenas.params.distributions import Workspace

_Tuple = TypeVar("_Tuple", bound=type)


def _naming_its_fields(cls: _Tuple) -> _Tuple:
    """A named tuple that says which names there are, where one is given that is none."""
    made, replaced, known = cls.__new__, cls._replace, cls._fields

    def check(names: Iterable[str]) -> None:
        for name in names:
            if name not in known:
                if "height" in name:
                    why = "heights of tables are the z of 'table_offsets'."
                elif close := keywords.nearest(name, known):
                    why = f"did you mean {close!r}?"
                else:
                    others = ", ".join(one for one in known if one != "terms")
                    why = f"one of `vary` is given as terms={{{name!r}: ...}}, and the others are {others}."
                raise TypeError(f"{name!r} is no quantity of {cls.__name__}: {why}")

    @functools.wraps(made)
    def new(cls: type, *args: Any, **quantities: Any) -> Any:
        check(quantities)
        if len(args) < len(known) and isinstance(quantities.get("terms", {}), Mapping):
            quantities["terms"] = dict(quantities.get("terms", {}))  # later changes of the caller's are none here
        return made(cls, *args, **quantities)

    @functools.wraps(replaced)
    def replace(self: Any, **quantities: Any) -> Any:
        check(quantities)
        return replaced(self, **quantities)

    cls.__new__, cls._replace = new, replace
    return cls


@_naming_its_fields
class ArenaParams(NamedTuple):
    """Parameters of one world: the numbers that may differ between the worlds of a batch.

    Attributes:
        table_offsets: (T, 3) centre of the top surface, in the world [m].
        table_rots: (T,) yaw about z [rad].
        table_full_sizes: (T, 3) length, width, thickness [m].
        table_frictions: (T, 3) sliding, torsional, rolling.
        has_legs: (T,) bool: whether the table has its legs.
        table_active: (T,) bool: whether the table is there. An absent table touches nothing and is not drawn; objects on it are absent as
            well.
        object_full_sizes: (K, 3) extents along the object's x, y, z [m]; for a mesh or an MJCF body they are fixed.
        object_masses: (K,) [kg]. The mass of an MJCF body includes everything that hangs on it.
        object_frictions: (K, 3) sliding, torsional, rolling.
        object_rgba: (K, 4) colour; for an MJCF body a factor on its own colours.
        object_tables: (K,) int, index of the table that the object stands on, or of a surface of furniture (`arena.surfaces`).
        object_active: (K,) bool: whether the object is there. An absent object touches nothing, is not drawn, has no mass and is parked far
            away.
        terms: (N, ...) numbers of each quantity that `arena.vary` made, by its name, for its N elements.
    """

    table_offsets: Array
    table_rots: Array
    table_full_sizes: Array
    table_frictions: Array
    has_legs: Array
    table_active: Array
    object_full_sizes: Array
    object_masses: Array
    object_frictions: Array
    object_rgba: Array
    object_tables: Array
    object_active: Array
    terms: Mapping[str, Array] = {}


@_naming_its_fields
class ArenaRanges(NamedTuple):
    """A distribution for each quantity of `ArenaParams`; quantities that are left out (None) stay nominal.

    A distribution gives the quantity of one table or object. Its numbers may differ by table or object, and by axis. There are T tables and
    K objects.

    Attributes:
        table_offsets: (T, 3) centre of the top surface, in the world [m].
        table_rots: (T,) yaw about z [rad].
        table_full_sizes: (T, 3) length, width, thickness [m].
        table_frictions: (T, 3) sliding, torsional, rolling.
        has_legs: (T,) whether legs are there: `Bernoulli`, `Count`, `Choice` or `Fixed`.
        table_active: (T,) which tables are there, with the same distributions as `has_legs`.
        object_full_sizes: (K, 3) extents along the object's x, y, z [m]; for meshes and MJCF bodies they are fixed.
        object_masses, object_densities: (K,) [kg], [kg/m^3]; give one of the two. If neither is given, the density is nominal, so a larger
            object is heavier.
        object_frictions: (K, 3) friction of contacts with other objects, robots and the floor. It counts on tables and furniture only if
            `table_priority` is 0; with the default of 1 their friction counts.
        object_rgba: (K, 4) colour between 0 and 1; for an MJCF body a factor on its own colours.
        object_tables: (K,) `Choice` of indices of tables and of surfaces of furniture (`arena.surfaces`). The choice is among those that
            are there in the world. Its `p` may be (K, N). Pass keys to `make_data`: without keys, objects that are drawn onto the same
            table may start inside each other.
        object_active: (K,) which objects are there, with the same distributions as `has_legs`.
        workspace: rectangle in which tables get random places apart from each other; it replaces x and y of `table_offsets`.
        terms: (N, ...) distributions of quantities that `arena.vary` made, by their names; None: the quantity stays nominal.
    """

    table_offsets: Distribution | None = None
    table_rots: Distribution | None = None
    table_full_sizes: Distribution | None = None
    table_frictions: Distribution | None = None
    has_legs: Distribution | None = None
    table_active: Distribution | None = None
    object_full_sizes: Distribution | None = None
    object_masses: Distribution | None = None
    object_densities: Distribution | None = None
    object_frictions: Distribution | None = None
    object_rgba: Distribution | None = None
    object_tables: Distribution | None = None
    object_active: Distribution | None = None
    workspace: Workspace | None = None
    terms: Mapping[str, Distribution | None] = {}

    def __hash__(self) -> int:
        return hash((*self[:-1], *sorted(self.terms.items(), key=lambda item: item[0])))

    @property
    def distributions(self) -> dict[str, Distribution]:
        """The distributions that are given, by the names of their quantities."""
        own = {name: dist for name, dist in self._asdict().items() if isinstance(dist, Distribution)}
        return own | self.given_terms

    @property
    def given_terms(self) -> dict[str, Distribution]:
        """Those of `terms`."""
        return {name: dist for name, dist in self.terms.items() if dist is not None}

    @property
    def varying(self) -> frozenset[str]:
        """Names of the parameters that differ between worlds."""
        given = [*self.distributions, *(["workspace"] if self.workspace is not None else [])]
        return frozenset(p for name in given for p in _DECIDES.get(name, (name,)))


# What a range decides besides, or instead of, the parameter of its name.
_DECIDES = {
    "workspace": ("table_offsets",),
    "object_full_sizes": ("object_full_sizes", "object_masses"),
    "object_densities": ("object_masses",),
    "object_tables": ("object_tables", "object_active"),
    "table_active": ("table_active", "object_active"),
}


LARGEST = 1e6
"""The largest length [m], angle [rad] and friction: single precision has steps of 6 cm there."""
_LENGTH = (mujoco.mjMINVAL, LARGEST)
_MASS = (mujoco.mjMINVAL, mujoco.mjMAXVAL)


def whole(x: Array) -> Array:
    """Elementwise, NumPy or JAX: a whole number."""
    return x == array_module(x).round(x)


class Together(NamedTuple):
    """A rule about all numbers of one table, object or element."""

    name: str  # of its sentence
    holds: Callable[[Array], Array]  # (N, ...) -> (N,) bool, NumPy or JAX
    ordered: bool = False  # of two numbers, whose order it is about
    best: Callable[[Array, Array], Array] | None = None
    """Of numbers (N, ...) between two bounds, some that hold if any do; None: not known."""


class Quantity(NamedTuple):
    """A parameter's shape, type, unit and bounds, which every rule about it needs."""

    of: str
    """The kind of thing that has it: "table", "object", "part", or the kind of element of a term."""
    item: tuple[int, ...] = ()
    """Shape of its numbers for one such thing."""
    kind: type = float
    """Type of its numbers: float, bool or int."""
    axes: str = ""
    """Names of its numbers, if there are several."""
    allowed: Callable[[Array], Array] | None = None
    """The numbers that are allowed besides being finite; elementwise, NumPy or JAX. None: all."""
    must: str = ""
    """The same in words, with the unit."""
    limits: tuple[float, float] = (-LARGEST, LARGEST)
    """Limits between which MuJoCo and single precision can compute."""
    together: Together | None = None
    """What the numbers of one thing must be together."""
    ids_of: str = ""
    """The kind of asset of which its numbers are ids: "texture" or "material"."""

    @property
    def counts(self) -> bool:
        """Whether its numbers say which of some things."""
        return self.allowed is whole

    @property
    def unit(self) -> str:
        """The unit of its numbers: [m], [rad], [kg] or nothing."""
        return self.must[self.must.find("[") :] if "[" in self.must else ""

    @property
    def between(self) -> str:
        """`limits` in words."""
        low, high = (f"{x:g}".replace("e+0", "e").replace("e+", "e") for x in self.limits)
        if (
            self.must.startswith("> 0") and self.limits[1] < LARGEST
        ):  # such as angles, for which the least number says nothing
            return f"> 0 and at most {high} {self.unit}".rstrip()
        return f"between {low} and {high} {self.unit}".rstrip()

    def right(self, x: Array) -> Array:
        """Elementwise, NumPy or JAX: a value that may be; NaN and infinity may not."""
        within = (x >= self.limits[0]) & (x <= self.limits[1])
        return within if self.allowed is None else within & self.allowed(x)


def _positive(x: Array) -> Array:
    return x > 0


def _not_negative(x: Array) -> Array:
    return x >= 0


def _fraction(x: Array) -> Array:
    return (x >= 0) & (x <= 1)


_FRICTION = Quantity(
    "table", (3,), float, "sliding, torsional, rolling", _not_negative, ">= 0 on every axis", (0, LARGEST)
)

QUANTITIES: dict[str, Quantity] = {
    "table_offsets": Quantity("table", (3,), float, "x, y, z", None, "[m]"),
    "table_rots": Quantity("table", (), float, "", None, "[rad]"),
    "table_full_sizes": Quantity(
        "table", (3,), float, "length, width, thickness", _positive, "> 0 on every axis [m]", _LENGTH
    ),
    "table_frictions": _FRICTION,
    "has_legs": Quantity("table", (), bool),
    "table_active": Quantity("table", (), bool),
    "object_full_sizes": Quantity("object", (3,), float, "x, y, z", _positive, "> 0 on every axis [m]", _LENGTH),
    "object_masses": Quantity("object", (), float, "", _positive, "> 0 [kg]", _MASS),
    "object_frictions": _FRICTION._replace(of="object"),
    "object_rgba": Quantity("object", (4,), float, "red, green, blue, alpha", _fraction, "between 0 and 1"),
    "object_tables": Quantity("object", (), int),
    "object_active": Quantity("object", (), bool),
}
"""Every parameter, in the order of `ArenaParams`."""

DENSITIES = QUANTITIES["object_masses"]._replace(must="> 0 [kg/m^3]")
"""A range without a parameter."""


class Selected(NamedTuple):
    """What there is to know of a quantity of `arena.vary` or of furniture."""

    quantity: Quantity
    elements: tuple[str, ...]  # (N,) names
    mask: np.ndarray  # (N, ...) bool: which of its numbers vary
    part: str = ""  # name of the part of furniture that they are of
    units: tuple[str, ...] = ()  # (N,) of each element; (): that of the quantity
    in_mjcf: Array | None = (
        None  # (N, ...) other numbers that the MJCF has, nan where it has the same; None: they are all the same
    )

    @property
    def rules(self) -> tuple[Quantity, ...]:
        """(N,) what there is to know of the numbers of each element, with its own unit."""
        one = self.quantity
        if not self.units:
            return (one,) * len(self.elements)
        return tuple(one._replace(must=one.must.removesuffix(one.unit) + unit) for unit in self.units)


def named(params: ArenaParams) -> dict[str, Array]:
    """The quantities of an arena with their values, by name."""
    return {name: getattr(params, name) for name in QUANTITIES} | dict(params.terms)


def with_values(params: ArenaParams, values: Mapping[str, Array]) -> ArenaParams:
    """The parameters with other values of some quantities, by name."""
    own = {name: value for name, value in values.items() if name in QUANTITIES}
    return params._replace(**own, terms=dict(params.terms) | {n: v for n, v in values.items() if n not in own})


def each(function: Callable[[Array], Any], params: ArenaParams) -> ArenaParams:
    """A function of the values of every quantity."""
    terms = {name: function(value) for name, value in params.terms.items()}
    return ArenaParams(*(function(getattr(params, name)) for name in QUANTITIES), terms=terms)


def canonical(params: ArenaParams) -> ArenaParams:
    """The parameters as JAX arrays: numbers in JAX's default precision, whatever came (integers, lists), and bool."""

    def term(value: Array) -> jax.Array:
        kind = (value if hasattr(value, "dtype") else np.asarray(value)).dtype
        return _of_kind(value, kind if kind == np.bool_ else jnp.result_type(float))

    own = (_of_kind(getattr(params, name), jnp.result_type(q.kind)) for name, q in QUANTITIES.items())
    return ArenaParams(*own, terms={name: term(value) for name, value in params.terms.items()})


def _of_kind(value: Array, dtype: Any) -> jax.Array:
    if isinstance(value, np.ndarray) and value.dtype.kind == np.dtype(dtype).kind:
        # Rounded here, since JAX would compile a program for each shape.
        with np.errstate(over="ignore"):
            value = value.astype(dtype)
    return jnp.asarray(value, dtype)


def on_host(params: ArenaParams) -> ArenaParams:
    """The parameters as NumPy arrays in double precision.

    Raises:
        TypeError: they are being traced.
    """
    if any(isinstance(p, jax.core.Tracer) for p in jax.tree.leaves(tuple(named(params).values()))):
        raise TypeError(
            "`params` must be numbers, got traced ones: what MuJoCo makes of them is outside jax.jit and jax.vmap."
        )

    def term(value: Array) -> np.ndarray:
        found = np.asarray(value)
        return found if found.dtype == bool else found.astype(float)

    own = (np.asarray(getattr(params, name), q.kind) for name, q in QUANTITIES.items())
    return ArenaParams(*own, terms={name: term(value) for name, value in params.terms.items()})
