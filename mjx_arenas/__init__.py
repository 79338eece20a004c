"""Thousands of randomized table-top arenas for MuJoCo MJX, compiled once."""

import sys
from typing import Any

import lazy_loader

__version__ = "0.1.0"

# The public names are those of `__init__.pyi`; each is imported when it is first used, so that nothing waits for JAX in vain.
_getattr, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name not in __all__:  # Python says which name is near, given the module
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name, obj=sys.modules[__name__])
    return _getattr(name)
