"""The pixel: models of ordered effects, and the sensor that steps them."""

from spikecam_env.sensor.effects import CATALOGUE, Effect, Stage
from spikecam_env.sensor.light import Keyframes
from spikecam_env.sensor.model import SensorModel
from spikecam_env.sensor.sensor import SensorState, SpikeSensor
from spikecam_env.sensor.unit import Circuit

__all__ = [
    "CATALOGUE",
    "Circuit",
    "Effect",
    "Keyframes",
    "SensorModel",
    "SensorState",
    "SpikeSensor",
    "Stage",
]
