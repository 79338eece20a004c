"""Thousands of randomized table-top arenas for MuJoCo MJX, compiled once."""

from mjx_arenas.arena import Arena as Arena
from mjx_arenas.arena import MultiTableArena as MultiTableArena
from mjx_arenas.arena import TableArena as TableArena
from mjx_arenas.batch import ArenaBatch as ArenaBatch
from mjx_arenas.batch import make_data as make_data
from mjx_arenas.batch import rollout as rollout
from mjx_arenas.batch import step as step
from mjx_arenas.data import place_static as place_static
from mjx_arenas.distributions import Bernoulli as Bernoulli
from mjx_arenas.distributions import Choice as Choice
from mjx_arenas.distributions import Distribution as Distribution
from mjx_arenas.distributions import Fixed as Fixed
from mjx_arenas.distributions import LogUniform as LogUniform
from mjx_arenas.distributions import Normal as Normal
from mjx_arenas.distributions import Uniform as Uniform
from mjx_arenas.objects import Object as Object
from mjx_arenas.params import ArenaParams as ArenaParams
from mjx_arenas.params import ArenaRanges as ArenaRanges
from mjx_arenas.placement import Placement as Placement
from mjx_arenas.world import MujocoWorldBase as MujocoWorldBase

__version__ = "0.1.0"
