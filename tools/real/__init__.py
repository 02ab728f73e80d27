"""The real recordings of a wall and of even light: what the preset `measured` is fitted to, and compared with."""
