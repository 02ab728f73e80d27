"""Surfaces: shapes and mesh files as triangles with their albedo."""
