"""Environments for training, on MuJoCo Playground's conventions; needs `pip install 'mjx_arenas[train]'`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
