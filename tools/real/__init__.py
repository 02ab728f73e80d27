"""The real recordings of a wall and of even light: the preset `measured` is fitted to them."""
