"""What a case of the benchmarks is."""

import dataclasses
import fnmatch
import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

SIZES = ("tiny", "cpu", "gpu")


@dataclasses.dataclass(frozen=True)
class Case:
    """One benchmark."""

    name: str
    run: str
    """`module:function` of this package, a generator of rows; imported when the case runs."""
    what: str
    sizes: Mapping[str, Mapping[str, Any]]
    """The function's arguments at each size; a size that is left out is not measured."""
    against: str = ""
    by: tuple[str, ...] = ()
    """Columns that tell rows apart; the others are metrics."""
    targets: Mapping[str, tuple[str, float]] = dataclasses.field(default_factory=dict)
    """What metrics should be on one H200 (size "gpu"), by patterns of their names."""

    def function(self) -> Callable[..., Iterator[dict[str, Any]]]:
        """What measures it."""
        module, _, name = self.run.partition(":")
        return getattr(importlib.import_module(f"benchmarks.{module}"), name)

    def metrics(self, row: Mapping[str, Any]) -> dict[str, Any]:
        """The metrics of a row, named `value.of.by.metric`."""
        prefix = [str(row[column]) for column in self.by]
        return {".".join([*prefix, name]): value for name, value in row.items() if name not in self.by}

    def target(self, metric: str) -> tuple[str, float] | None:
        """What a metric should be, if that was said."""
        return next((t for pattern, t in self.targets.items() if fnmatch.fnmatchcase(metric, pattern)), None)
