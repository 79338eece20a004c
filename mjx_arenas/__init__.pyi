from .arena import Arena as Arena
from .batch import ArenaBatch as ArenaBatch
from .batch import capacity as capacity
from .batch import make_data as make_data
from .batch import rollout as rollout
from .batch import step as step
from .data import Capacity as Capacity
from .data import place_static as place_static
from .distributions import Bernoulli as Bernoulli
from .distributions import Choice as Choice
from .distributions import Count as Count
from .distributions import Distribution as Distribution
from .distributions import Fixed as Fixed
from .distributions import LogUniform as LogUniform
from .distributions import Normal as Normal
from .distributions import Uniform as Uniform
from .distributions import Workspace as Workspace
from .objects import Object as Object
from .params import ArenaParams as ArenaParams
from .params import ArenaRanges as ArenaRanges
from .placement import Placement as Placement
from .setconst import set_const as set_const
from .table_arenas import MultiTableArena as MultiTableArena
from .table_arenas import TableArena as TableArena
from .world import MujocoWorldBase as MujocoWorldBase

__version__: str
