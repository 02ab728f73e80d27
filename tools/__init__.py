"""Programs that build what is shipped; run from a checkout, `python -m tools.NAME`.  Not installed."""
