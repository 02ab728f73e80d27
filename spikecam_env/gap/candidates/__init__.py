"""Effects that may be missing: their properties, and their place in a model."""
