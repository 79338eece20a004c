from .base import ArenaEnv as ArenaEnv
from .base import Episode as Episode
from .brax_env import BraxEnv as BraxEnv
from .push import Push as Push
from .static_geoms import StaticGeoms as StaticGeoms
