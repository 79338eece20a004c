"""Thousands of randomized table-top arenas for MuJoCo MJX, compiled once."""

import lazy_loader

__version__ = "0.1.0"

# The public names are those of `__init__.pyi`; each is imported when it is first used, so that nothing waits for JAX in vain.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
