"""Furniture, whose sizes, places and counts vary in each world: `arena.add_part(mja.furniture.Shelf("rack"))`."""

from mjx_arenas.furniture import layouts as layouts
from mjx_arenas.furniture.bin import Bin as Bin
from mjx_arenas.furniture.counter import Counter as Counter
from mjx_arenas.furniture.cupboard import Cupboard as Cupboard
from mjx_arenas.furniture.drawers import Drawers as Drawers
from mjx_arenas.furniture.part import Part as Part
from mjx_arenas.furniture.rail import Rail as Rail
from mjx_arenas.furniture.shelf import Shelf as Shelf
from mjx_arenas.furniture.steps import Ramp as Ramp
from mjx_arenas.furniture.steps import Steps as Steps
from mjx_arenas.furniture.wall import Wall as Wall
from mjx_arenas.furniture.zone import Zone as Zone
