"""Recordings that are rates only: how pixels differ, in the light and in the dark, is all that can be tested.

A twin is a fresh unit of the model, counted as the maps were; its median response and dark level are the measured ones.
Before the fits, spreads of response and of dark level are free within the differences of units
(`settings.UnitSettings.spread_limits`).  In the fits they have no limit: one further off is a wrong parameter.
"""

from spikecam_env.gap.maps.diagnose import diagnose_maps

__all__ = ["diagnose_maps"]
