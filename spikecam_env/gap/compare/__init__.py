"""Measurement against prediction: the distance between them, and the step that comes nearer."""
