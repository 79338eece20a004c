"""Environments for training, on MuJoCo Playground's conventions; needs `pip install 'mjx_arenas[train]'`."""

from typing import Any

import lazy_loader

_getattr, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    try:
        return _getattr(name)
    except ModuleNotFoundError as error:
        if str(error.name).startswith("mjx_arenas"):
            raise
        needed = f"mjx_arenas.envs.{name} needs {error.name}: pip install 'mjx_arenas[train]'."
        raise ModuleNotFoundError(needed, name=error.name) from None
