"""What `spikecam bench` measures, a file each: speed, as ratios to a baseline of the same run, and errors of light."""
