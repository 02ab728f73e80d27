"""What `spikecam play` and `spikecam view` show: episodes, pictures and figures, on a screen, in a film, in rerun."""
