"""Worlds: rigid bodies in space, seen by a camera at the sensor's speed.

spec     what a world is made of, and where its camera sees it
extent   where a body is seen: points that stand for its surface, boxes of pixels, windows
plan     what follows from the motion in a block of frames: how often to render, in which order to lay bodies
cache    what a world keeps for its next call, and how much of it
sky      what lies behind all bodies
sprites  bodies rendered at an instant itself
paint    light at key frames, from bodies rendered seldom and carried by their motion
truth    ground truth at an instant
world    the scene made of these
"""

from scenes.world.spec import Body
from scenes.world.world import World

__all__ = ["Body", "World"]
