"""Arms for tasks: those that come along, and what a user's own is made of."""

from mjx_arenas.envs.arms.arm import Arm, ready, servo
from mjx_arenas.envs.arms.known import ARMS, panda, small, yam
from mjx_arenas.envs.arms.report import check

__all__ = ["ARMS", "Arm", "check", "panda", "ready", "servo", "small", "yam"]
