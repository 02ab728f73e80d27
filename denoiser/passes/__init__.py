"""Passes: a rolling window of a stream, a network over it, and the planes that it gives."""
