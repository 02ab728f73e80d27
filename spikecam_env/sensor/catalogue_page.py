"""The place where `Sheet` was: for the diagnosis, until it imports `spikecam_env.sensor.sheet`."""

from spikecam_env.sensor.sheet import Sheet

__all__ = ["Sheet"]
