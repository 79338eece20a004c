"""What worlds of an arena are drawn as, and how likely (pure)."""

import jax
import jax.numpy as jnp
import numpy as np

from mjx_arenas import strict
from mjx_arenas.compiled import Compiled
from mjx_arenas.keywords import with_known_methods
from mjx_arenas.params.params import ArenaParams, ArenaRanges, canonical, with_values
from mjx_arenas.problem import problem
from mjx_arenas.problems import messages
from mjx_arenas.rules import validation, validation_ranges
from mjx_arenas.sample.poses import Pose, listed
from mjx_arenas.sample.variants import with_own_numbers
from mjx_arenas.sim import programs


@with_known_methods
class Drawn(Compiled):
    """The part of an arena that draws parameters: functions of one world, for `jax.vmap`."""

    @strict.own_constants
    def nominal_params(self) -> ArenaParams:
        """Parameters of the arena as it was configured."""
        return canonical(self._nominal)

    @strict.own_constants
    def sample_params(self, key: jax.Array, ranges: ArenaRanges) -> ArenaParams:
        """Draws the parameters of one world; jit, vmap.

        Args:
            key: key of the world. Each quantity, and in it each table (by its index) and object (by its name), folds its
                own key from it. So a draw does not depend on what else is drawn.
            ranges: what varies; the rest is nominal. They may be traced.
        """
        self._check_spec()
        self.check_ranges(ranges)
        validation.raise_all(validation.one_key_problems("key", key), "`key`")
        return programs.sample(self.drawing, key, ranges)

    @strict.own_constants
    def encode(self, params: ArenaParams, ranges: ArenaRanges) -> jax.Array:
        """(D,) the draws of one world as a point of the unit cube; jit, vmap.

        This is the inverse of `decode`. It has one number for each draw of `ranges`; tied draws share one. A number outside its range
        is clipped to it. A draw without influence on the world gets 0.5. A choice gets the middle of its interval.

        Args:
            params: parameters of one world.
            ranges: what varies, without a `workspace`. They may be traced.
        """
        self._check_coded(ranges)
        self._check_shapes(params)
        return programs.encode(self.drawing, params, ranges)

    @strict.own_constants
    def decode(self, vector: jax.Array, ranges: ArenaRanges) -> ArenaParams:
        """The parameters of one world for a point of the unit cube; jit, vmap, grad.

        Uniform points give worlds of the same distribution as `sample_params`. Use points of a Sobol sequence, or the proposals of an
        optimizer, to search the ranges (docs/terms.md).

        Args:
            vector: (D,) between 0 and 1; D is the length of `encode(nominal_params(), ranges)`. Traced vectors are clipped to the cube;
                other vectors outside of it raise an error.
            ranges: as in `encode`.
        """
        self._check_coded(ranges)
        validation.raise_all(validation.point_problems(vector, programs.dimensions(self.drawing, ranges)), "`vector`")
        return programs.decode(self.drawing, vector, ranges)

    @strict.own_constants
    def log_prob(self, params: ArenaParams, ranges: ArenaRanges) -> jax.Array:
        """() the log density of one world's parameters under ranges, -inf if the ranges cannot produce them; jit, vmap, grad.

        The density refers to the numbers in `params`, in their units, also for relative ranges and for masses that follow from
        densities. Densities under two ranges can therefore be divided. A number that has a probability of its own (a choice, the bound
        of a clipped normal) contributes that probability. Tied numbers count once, as the first of them.

        Args:
            params: parameters of one world.
            ranges: as in `encode`.
        """
        self._check_coded(ranges)
        self._check_shapes(params)
        return programs.log_prob(self.drawing, params, ranges)

    @strict.own_constants
    def with_variants(self, params: ArenaParams, **which: str | int) -> ArenaParams:
        """Parameters of one world with other variants of objects, and with their sizes, masses, frictions and colours; jit, vmap.

        Args:
            params: parameters of one world.
            which: names or indices of variants, by the names of their objects.

        Raises:
            ValueError: there is no such object, or it has no such variant.
        """
        self._check_shapes(params)
        params, known = canonical(params), {o.name: o for o in self.objects if o.variants is not None}
        problems, chosen = [], []
        for name, given in which.items():
            if name not in known:
                problems.append(
                    problem(f"with_variants.{name}", "no_variants", None, name, names=list(known) or ["none"])
                )
                continue
            one = next(v for v in self._parts.places.variants if self.objects[v.object].name == name)
            number = one.names.index(given) if given in one.names else given
            if validation.is_whole(number, 0, len(one.names) - 1):
                chosen.append((one, number))
            else:
                listed = [repr(variant) for variant in one.names]
                problems.append(problem(f"with_variants.{name}", "no_variant", None, given, names=listed))
        validation.raise_all(problems, "with_variants")
        numbers = {one.quantity: jnp.full(1, float(number)) for one, number in chosen}  # type: ignore[arg-type]
        return with_own_numbers(with_values(params, numbers), [one for one, _ in chosen])

    def poses(self, name: str, variant: int = 0) -> tuple[Pose, ...]:
        """The resting poses of an object with `pose="resting"`; `params.terms["{name}.pose"]` is an index into them.

        The first is the pose nearest to upright. Primitive shapes have the same poses at every size (docs/placement.md).

        Args:
            name: name of the object.
            variant: index of the variant, if it has variants.

        Raises:
            ValueError: there is no such object, or it has no such variant.
        """
        known = {self.objects[one.object].name: one for one in self._parts.places.poses}
        if name not in known:
            raise messages.error([problem("name", "no_poses", None, name, names=[*map(repr, known)] or ["none"])])
        one = known[name]
        variant = validation.whole("variant", variant, 0, len(one.kind) - 1)
        sizes = [v.full_size for v in self._parts.places.variants if v.object == one.object]
        own = sizes[0][variant] if sizes else self._nominal.object_full_sizes[one.object]
        return listed(one, variant, np.asarray(own, float))

    def _check_spec(self) -> None:
        """Refuses edits of what is compiled; compiles nothing."""
        if self.is_compiled:
            self.unchanged()

    def _check_coded(self, ranges: ArenaRanges) -> None:
        self._check_spec()
        self.check_ranges(ranges)
        validation.raise_all(
            validation_ranges.coded_problems(ranges, self._nominal, self._parts.places.ground), "`ranges`"
        )

    def _check_shapes(self, params: ArenaParams) -> None:
        validation.raise_all(validation.shape_problems(params, self._labels), "`params`")
