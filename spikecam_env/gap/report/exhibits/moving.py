"""Moving light: too many or too few spikes, by the change of the light."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from spikecam_env.gap.report.panels import Array, PlotPanel, largest, takes
from spikecam_env.gap.result import Evidence
from spikecam_env.gap.statistics.film import light_film

TITLE = "Moving light"
CAPTION = (
    "Spikes relative to the model's, over all pixels and times with the same change of light: brightening, brighter "
    "just before (lag), brighter neighbours (blur, crosstalk), brightening in low rows (rows read at other times)."
)


def panels(evidence: Evidence, frame_rate_hz: float) -> Iterator[PlotPanel]:
    """Spikes too many or too few where moving light brightens, has just been brighter, has brighter neighbours ..."""
    made = []
    for t in takes(evidence, ("moving",)):
        films = [o.film if o is not None else None for o in (t.measured, t.before, t.after)]
        if films[0] is None or films[1] is None:
            continue
        assert t.shown.light is not None
        for name, feature in light_features(light_film(t.shown.light, t.shown.frames), t.measured.shape).items():
            panel = _over_feature(f"{name} ({t.shown.name})", feature, films)
            if panel:
                made.append(panel)
    yield from largest(made, 4)


def light_features(light: Array, shape: tuple[int, int]) -> dict[str, Array]:
    """Changes of a film of light (bins, P) that a pixel may notice, (bins, P) each, relative to the mean light."""
    bins = len(light)
    film = (light / max(float(light.mean()), 1e-12)).reshape(bins, *shape)
    change = np.gradient(film, axis=0)
    past = film.copy()
    for i in range(1, bins):
        past[i] = 0.75 * past[i - 1] + 0.25 * film[i]
    padded = np.pad(film, ((0, 0), (1, 1), (1, 1)), mode="edge")
    around_it = (padded[:, 2:, 1:-1] + padded[:, :-2, 1:-1] + padded[:, 1:-1, 2:] + padded[:, 1:-1, :-2]) / 4
    row = (np.arange(shape[0]) / max(shape[0] - 1, 1) - 0.5)[None, :, None]
    per_pixel = {
        "Where it brightens": change,
        "Where it was brighter just before": past - film,
        "Where neighbours are brighter": around_it - film,
        "Where it brightens in low rows": row * change,
    }
    return {name: f.reshape(bins, -1) for name, f in per_pixel.items()}


def _over_feature(title: str, feature: Array, films: Sequence[NDArray[np.uint8] | None]) -> PlotPanel | None:
    """Spikes of bins of a feature with as many entries each; None where the feature does not vary."""
    edges = np.unique(np.quantile(feature, np.linspace(0, 1, 10)))
    if edges.size < 4 or np.ptp(edges) < 1e-9:
        return None
    where = np.clip(np.searchsorted(edges, feature.reshape(-1), side="right") - 1, 0, edges.size - 2)
    size = np.maximum(np.bincount(where, minlength=edges.size - 1), 1)

    def mean(values: Array) -> Array:
        return np.bincount(where, values, edges.size - 1) / size

    measured, before, after = (None if f is None else f.reshape(-1).astype(np.float64) for f in films)
    assert measured is not None and before is not None
    off = measured - before
    scale = 100 / np.maximum(mean(before), 1e-9)
    sd = np.sqrt(np.maximum(mean(off**2) - mean(off) ** 2, 0) / size)
    return PlotPanel(
        title, "difference in light, over the mean light [1]", "spikes over the model's, less 1 [%]",
        mean(feature.reshape(-1)), scale * mean(off), np.zeros(edges.size - 1),
        None if after is None else scale * mean(after - before), scale * sd,
    )  # fmt: skip
