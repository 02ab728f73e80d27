"""Before a search: the null model, the alarm, and quantities that the refit shows to be missing or off nominal."""
