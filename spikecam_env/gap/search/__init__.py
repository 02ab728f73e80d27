"""The search: one effect after another, while something is left."""
