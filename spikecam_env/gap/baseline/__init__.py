"""Before a search: the null model, contradictions of the recordings, and effects that the refit shows to be missing."""
