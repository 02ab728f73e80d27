"""Flat scenes: textured planes, discs and shapes, painted key by key."""
