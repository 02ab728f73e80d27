"""Films and pictures of a user's own, as linear light."""

from scenes.film.film_files import Film, FilmOptions, read_film
from spikecam_env.renamed import old_names

__all__ = ["Film", "FilmOptions", "read_film"]

__getattr__ = old_names(__name__, {"Reading": "FilmOptions"})
