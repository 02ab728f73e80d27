"""The place where `Sheet` was: for the diagnosis, until it imports `spikecam_env.sensor.effect_sheet`."""

from spikecam_env.sensor.effect_sheet import Sheet

__all__ = ["Sheet"]
