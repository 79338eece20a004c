"""Environments for training, on MuJoCo Playground's conventions; needs `pip install 'mjx_arenas[train]'`."""

from mjx_arenas.envs.base import ArenaEnv as ArenaEnv
from mjx_arenas.envs.base import Episode as Episode
from mjx_arenas.envs.push import Push as Push
from mjx_arenas.envs.static_geoms import StaticGeoms as StaticGeoms
