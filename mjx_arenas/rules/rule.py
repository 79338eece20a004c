"""What a rule about a world is, and what rules know of an arena."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from mjx_arenas.furniture.part import Part
from mjx_arenas.geometry import Array
from mjx_arenas.params.distributions import Workspace
from mjx_arenas.params.params import ArenaParams, Selected
from mjx_arenas.sample.fixed import NOTHING, Fixed
from mjx_arenas.sample.poses import Poses
from mjx_arenas.sample.tops import Carrier, Ground
from mjx_arenas.sample.variants import Variants
from mjx_arenas.spec.follow import Follower

Held: TypeAlias = Mapping[int, str]  # tables t and objects T + k that cannot be absent, with the reason, a clause


class Limits(NamedTuple):
    """N joints and tendons whose ranges or margins vary."""

    names: tuple[str, ...]
    """(N,) what messages call them."""
    nominal: np.ndarray
    """(N, 3) lower limit, upper limit and margin."""
    quantities: tuple[str, ...]
    """Terms that decide some of these numbers."""
    places: np.ndarray
    """(N, 3) where they are among the nominal numbers and, after these, those of the terms, and the ranges of the parts' joints."""
    parts: tuple[Part, ...] = ()
    """Parts of furniture that have some of the joints."""


NO_LIMITS = Limits((), np.zeros((0, 3)), (), np.zeros((0, 3), int))


class Sliding(NamedTuple):
    """P contacts whose sliding friction parameters decide."""

    names: tuple[str, ...]
    """(P,) what messages call them."""
    nominal: np.ndarray
    """(N,) numbers of geoms and pairs."""
    quantities: tuple[str, ...]
    """What decides others."""
    places: np.ndarray
    """(P, 2) of which two the larger counts, among the nominal numbers and, after these, those of the quantities."""


NO_SLIDING = Sliding((), np.zeros(0), (), np.zeros((0, 2), int))


class Rules(NamedTuple):
    """What decides, beside its parameters, whether a world of an arena can be."""

    n_tables: int
    object_names: tuple[str, ...]
    object_kinds: np.ndarray  # (K,) their types
    object_full_sizes: np.ndarray  # (K, 3) nominal [m]; those of files stay
    held: Held
    drawn: bool = False  # from ranges: a table must be there
    workspace: Workspace | None = None
    overlapping: np.ndarray | None = None  # (T, T) bool: tables that overlap nominally, by intent; None: any may
    ordered: Array | bool = True  # () bool: the ranges' bounds are in order, and probabilities are some
    terms: Mapping[str, Selected] = {}  # of `arena.vary` and of furniture
    furniture: tuple[Part, ...] = ()
    variants: tuple[Variants, ...] = ()  # of the objects that have some
    poses: tuple[Poses, ...] = ()  # of the objects that may rest in several
    carriers: tuple[Carrier, ...] = ()  # objects on which others stand
    touching: np.ndarray | None = (
        None  # (T + N, T + N) bool: tables and boxes of furniture that overlap nominally, by intent
    )
    follows: tuple[Follower, ...] = ()  # geoms of a scene that follow its tables
    fixed: Fixed = NOTHING  # geoms that no joint moves, and the floor
    inside: np.ndarray | None = (
        None  # (T + N, B + F) bool: pairs of these that overlap nominally, by intent, or need not be apart
    )
    sunk: np.ndarray | None = None  # (P,) bool: parts that nominally stand below the floor, by intent
    low: np.ndarray | None = None  # (T,) bool: tables whose top is nominally below the floor, by intent; None: any may
    limits: Limits = NO_LIMITS
    sliding: Sliding = NO_SLIDING
    tables: tuple[int, ...] = ()  # (T,) what sentences call the tables (`problem.numbered`); (): their numbers

    @property
    def called(self) -> Sequence[int]:
        """(T,) what sentences call the tables."""
        return self.tables or range(self.n_tables)

    @property
    def ground(self) -> Ground:
        """What objects stand on beside tables."""
        return Ground(self.furniture, self.carriers, self.poses)


class Rule(NamedTuple):
    """A row of the table."""

    name: str  # of its sentence
    path: str  # of the argument that it is about
    of: str  # "table", "object", "tables" (two), "any" (tables, then objects), "world", or "term": the one in the path
    reads: tuple[str, ...]  # quantities of which all must be right, or nothing is said
    holds: Callable[[ArenaParams, Rules], Array]  # (T,), (K,), (T, T), (T + K,) or () bool
    told: Callable[[ArenaParams, Rules, Any], Mapping[str, Any]]  # `got` and the numbers of the sentence
    shown: bool = False  # a world that only this rules out is compiled and shown as it is
