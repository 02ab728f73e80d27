"""From a search to a verdict: named effects, the remainder and its place, and bounds on other effects."""
