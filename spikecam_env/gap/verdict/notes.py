"""Notes on a diagnosis that change how its gap is to be read."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

from spikecam_env.gap.search.round import Round


class Note(str, Enum):
    """Why the gap on recordings held out is no check.  The value is the sentence that page, terminal and JSON state."""

    PARAMETERS_FROM_HELD_OUT = (
        "The held-out recordings were fitted too, within the errors of the first fit: the gap on them is no "
        "independent check."
    )
    """The recordings to fit left parameters open, and those held out were fitted too."""

    ONLY_HELD_OUT_DISAGREE = (
        "The recordings to fit agree with the model, as given or with the effects found first; those held out do not. "
        "Held-out recordings of moving light were therefore fitted: the gap on them is no independent check."
    )
    """Only held-out motion disagrees with the model."""

    __str__ = str.__str__  # the sentence, as StrEnum has it from Python 3.11 on


def notes_of(rounds: Sequence[Round]) -> list[str]:
    """Notes on the rounds of a search whose effects were kept."""
    from_held_out = [Note.PARAMETERS_FROM_HELD_OUT] if any(r.used_held_out for r in rounds) else []
    return [*from_held_out, *([Note.ONLY_HELD_OUT_DISAGREE] if any(r.motion_alone for r in rounds) else [])]


def gap_is_fitted(notes: Sequence[str]) -> bool:
    """Whether recordings held out were fitted, by the kinds of notes and not by their words."""
    return any(isinstance(note, Note) for note in notes)
