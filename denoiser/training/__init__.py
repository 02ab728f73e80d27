"""Training: simulated streams, lessons, and a run that can go on where it was stopped."""
