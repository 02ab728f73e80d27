"""Simulated campaigns of the measured unit under a model, its recordings in the same light."""
