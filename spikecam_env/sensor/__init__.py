"""The pixel: models of ordered effects, and the sensor that steps them; and an event camera on the same light."""

from typing import TYPE_CHECKING, Any

from spikecam_env.sensor.effects import CATALOGUE, Effect, Stage
from spikecam_env.sensor.event_camera import EventCamera, EventCameraState, EventList, EventPixel
from spikecam_env.sensor.light import Keyframes
from spikecam_env.sensor.model import SensorModel
from spikecam_env.sensor.own_effects import effects_from, load_effects, load_installed_effects
from spikecam_env.sensor.sensor import SensorState, SpikeSensor, step_together
from spikecam_env.sensor.unit import Circuit, Unit

if TYPE_CHECKING:
    from spikecam_env.sensor.batch import SensorBatchState, SpikeSensorBatch

__all__ = [
    "CATALOGUE",
    "Circuit",
    "Effect",
    "EventCamera",
    "EventCameraState",
    "EventList",
    "EventPixel",
    "Keyframes",
    "SensorBatchState",
    "SensorModel",
    "SensorState",
    "SpikeSensor",
    "SpikeSensorBatch",
    "Stage",
    "Unit",
    "effects_from",
    "load_effects",
    "load_installed_effects",
    "step_together",
]


def __getattr__(name: str) -> Any:
    """Batches need torch, which takes seconds to import: only when asked for."""
    if name in ("SensorBatchState", "SpikeSensorBatch"):
        from spikecam_env.sensor import batch

        return getattr(batch, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
