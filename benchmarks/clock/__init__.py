"""The array's clock and its disturbance c(v) of the threshold: a law of phases, own pixels, a campaign."""
