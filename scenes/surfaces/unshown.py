"""Parts of a mesh file that no surface shows: one name for each, whatever the format."""

TRANSPARENCY = "transparency (drawn opaque)"
ALPHA_MASK = "an alpha mask (drawn opaque)"
METAL, GLOSS, NORMAL_MAPS, EMISSION = "metal", "gloss", "normal maps", "emission"
LINES = "points and lines"
NO_COORDINATES = "a texture without coordinates"
