"""Episodes, pictures and figures of `spikecam play`, `live` and `view`: on a screen, in a film, in rerun."""
