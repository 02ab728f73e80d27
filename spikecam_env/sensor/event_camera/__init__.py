"""An event camera: pixels that report changes of the logarithm of their light, one by one.

Start reading at `pixel.py`, the law; `loop.py` solves it from event to event; `camera.py` is the camera you can step.
"""

from spikecam_env.sensor.event_camera.camera import EventCamera, EventCameraState
from spikecam_env.sensor.event_camera.event_list import EventList
from spikecam_env.sensor.event_camera.pixel import EventPixel

__all__ = ["EventCamera", "EventCameraState", "EventList", "EventPixel"]
