"""Effects that may be missing: what is known of each, and its place in a model."""
