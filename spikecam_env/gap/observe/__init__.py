"""A recording in numbers: what the camera was shown, and what the passes over its bits found."""
