"""From a search to a verdict: what is named, what is left and where, and bounds on what was not found."""
