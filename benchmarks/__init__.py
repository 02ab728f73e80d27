"""Measurements behind the figures of the docs; run from a checkout, `python -m benchmarks.NAME`.  Not installed."""
