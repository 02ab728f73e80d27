"""Worlds: rigid bodies in space, seen by a camera at the sensor's speed.

- spec: bodies, camera and light of a world
- extent: where a body is seen, as points that stand for its surface, boxes of pixels, windows
- plan: consequences of the motion in a block of frames, i.e. how often to render, in which order to lay bodies
- cache: results kept for the next call, and their limits
- sky: the background behind all bodies
- sprites: bodies rendered at an instant itself
- paint: light at key frames, from bodies rendered seldom and carried by their motion
- truth: ground truth at an instant
- world: the scene made of these
"""

from scenes.world.spec import Body
from scenes.world.world import World

__all__ = ["Body", "World"]
