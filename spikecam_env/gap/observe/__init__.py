"""A recording in numbers: its light, and the sums of the passes over its bits."""
