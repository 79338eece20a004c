"""Modules that extras of the package bring."""

import importlib
from types import ModuleType


def extra(module: str) -> ModuleType:
    """A module that the extra `[viz]` brings."""
    try:
        return importlib.import_module(module)
    except ImportError:
        raise ImportError(f"This needs {module.partition('.')[0]}: pip install 'mjx_arenas[viz]'.") from None
