"""Programs that build shipped files; run from a checkout, `python -m tools.NAME`.  Not installed."""
