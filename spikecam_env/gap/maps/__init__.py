"""Recordings that are rates only: how pixels differ, in the light and in the dark, is all that can be tested.

A twin is a fresh unit of the model, counted as the maps were; its median response and dark level are the measured ones.
Spreads of response and of dark level are free within what units differ by (`settings.UnitSettings.spread_limits`)
before, and without limit in the fits; one that then is further off than units are is a parameter that is wrong.
"""

from spikecam_env.gap.maps.diagnose import diagnose_maps

__all__ = ["diagnose_maps"]
