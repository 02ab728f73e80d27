"""The verdict on recordings of wrong labels, said to be static and in motion, and the way on."""

from __future__ import annotations

from spikecam_env.gap.check.motion import DetectedMotion
from spikecam_env.gap.check.static_part import ENOUGH_STATIC, static_pixels
from spikecam_env.gap.result import Conclusion
from spikecam_env.sensor import SensorModel

TO_DO = (
    "To go on, crop the recordings to a static part (spikecam campaign import with --rows and --columns), or use only "
    "the static pixels (spikecam diagnose --static-only)."
)

TO_DO_IN_KNOWN_LIGHT = "In known light, give the light over time (an .npz) as the label, or leave the recording out."


def moves(model: SensorModel, motion: tuple[DetectedMotion, ...], *, static_only: bool) -> Conclusion:
    """The verdict `data`: nothing was compared."""
    notes = (*(m.text for m in motion), *what_to_do(motion, static_only))
    return Conclusion(verdict="data", data=notes, patched=model)


def what_to_do(motion: tuple[DetectedMotion, ...], static_only: bool) -> list[str]:
    """Steps that make the campaign usable."""
    share = float(static_pixels(motion).mean())
    advice = [TO_DO] if any(not m.light_known for m in motion) else []
    if any(m.light_known for m in motion):
        advice.append(TO_DO_IN_KNOWN_LIGHT)
    if static_only and share < ENOUGH_STATIC:
        advice.insert(0, f"{100 * share:.3g} % of pixels are static; --static-only needs {100 * ENOUGH_STATIC:g} %.")
    return advice


def static_note(motion: tuple[DetectedMotion, ...]) -> list[str]:
    """Notes on the pixels that were left out because they move."""
    if not motion:
        return []
    share = 100 * float(static_pixels(motion).mean())
    return [f"Only the static pixels of unknown scenes were used, {share:.3g} % of all.", *(m.text for m in motion)]
