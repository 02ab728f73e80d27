"""Measurement against prediction: what a model gives, how far off the measurement is, and which step comes nearer."""
