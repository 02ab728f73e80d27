"""Measurements of `spikecam bench`, a file each: speed, as ratios to a baseline of the same run."""
