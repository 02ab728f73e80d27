"""Intervals without an update: right where the rate stays, and blind to its change until the interval is over."""

from __future__ import annotations

import numpy as np

from denoiser.decoders import held, mus

SHAPE = (16, 16)


def test_a_steady_rate_gives_the_spikes_of_the_multi_stage_update() -> None:
    rates = np.full((300, *SHAPE), 0.13, np.float32)
    ours, theirs = (decoder.step(rates, decoder.start(SHAPE))[0] for decoder in (held, mus))
    np.testing.assert_array_equal(ours, theirs)
    assert abs(ours.mean() - 0.13) < 0.005


def test_after_a_step_up_an_interval_is_kept_to_its_end_where_the_update_shortens_it() -> None:
    """From an interval of 50 frames to one of 4: until the old one is over, 25 frames pass on average."""
    rates = np.full((200, *SHAPE), 0.02, np.float32)
    rates[100:] = 0.25
    first = {}
    for name, decoder in (("held", held), ("mus", mus)):
        spikes, _ = decoder.step(rates, decoder.start(SHAPE))
        first[name] = spikes[100:].argmax(axis=0)
    print({name: float(t.mean()) for name, t in first.items()})
    assert first["mus"].max() <= 4
    assert 15 < first["held"].mean() < 35 and first["held"].max() > 40
