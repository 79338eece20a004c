from .base import ArenaEnv as ArenaEnv
from .base import Episode as Episode
from .curriculum import widening as widening
from .push import Push as Push
from .static_geoms import StaticGeoms as StaticGeoms
