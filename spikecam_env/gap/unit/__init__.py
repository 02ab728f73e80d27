"""The measured unit: response, dark level and jitter of every pixel, refitted from the recordings."""
