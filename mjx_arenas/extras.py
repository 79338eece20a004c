"""Modules that extras of the package bring."""

import importlib
from types import ModuleType


def extra(module: str, name: str = "viz") -> ModuleType:
    """A module that an extra brings.

    Raises:
        ImportError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise ImportError(f"This needs {module.partition('.')[0]}: pip install 'mjx_arenas[{name}]'.") from None
