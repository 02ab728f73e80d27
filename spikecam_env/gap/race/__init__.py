"""One search over sets of effects: neighbours of the best hypothesis race, fewest twins first (docs/gap.md)."""
