from .base import ArenaEnv as ArenaEnv
from .base import Episode as Episode
from .brax_env import BraxEnv as BraxEnv
from .curriculum import widening as widening
from .push import Push as Push
from .registry import register as register
from .static_geoms import StaticGeoms as StaticGeoms
from .transfer import Transfer as Transfer
