"""One candidate, or all that were found together, fitted to the measurement by twins."""
