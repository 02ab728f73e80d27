"""Made-up diagnoses over real observations: small simulated campaigns, and possible diagnoses of them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from spikecam_env.gap.observe.conditions import Condition
from spikecam_env.gap.observe.observation import ObservedRecording, observe
from spikecam_env.gap.result import (
    EXPLAINS_ALL,
    EXPLAINS_NEARLY_ALL,
    LARGEST,
    Bound,
    Diagnosis,
    Estimate,
    Evidence,
    Gap,
    NamedEffect,
    Ranked,
    Remainder,
    Statistic,
)
from spikecam_env.gap.twins.fresh_units import drawn_response
from spikecam_env.gap.unit.refit import free_refit
from spikecam_env.gap.verdict.named_effects import estimates
from spikecam_env.sensor import CATALOGUE, Keyframes, SensorModel, SpikeSensor
from spikecam_env.streams import pack_frames

SHAPE = (24, 24)
FRAMES = 1500
MODEL = SensorModel.preset("scsim")

EFFECTS = {
    "photodiode_lag": {"fraction": 0.06, "tau_us": 1200.0},
    "dead_time": {"tau_us": 1.0},
    "light_flicker": {"modulation": 0.03, "frequency_hz": 100.0},
}


def conditions() -> tuple[Condition, ...]:
    """Dark, four flats, a step and moving bars to fit; a flat and bars of another speed held out."""
    uniform = [("dark", 0.0, "fit"), ("flat-050", 0.05, "fit"), ("flat-120", 0.12, "fit"), ("flat-300", 0.3, "fit"),
               ("flat-600", 0.6, "fit"), ("flat-200", 0.2, "holdout")]  # fmt: skip
    flats = [
        Condition(name, "flat" if level else "dark", level,
                  Keyframes(np.zeros(1), np.full((1, *SHAPE), level, np.float32)),
              FRAMES, use)
        for name, level, use in uniform
    ]  # fmt: skip
    return (*flats, _step(), _bars("bars", 0.02, "fit"), _bars("bars-fast", 0.05, "holdout"))


def _step() -> Condition:
    frame = np.array([0.0, 499.0, 500.0, 999.0, 1000.0])
    level = np.array([0.1, 0.1, 0.4, 0.4, 0.1], np.float32)
    light = Keyframes(frame, np.broadcast_to(level[:, None, None], (5, *SHAPE)))
    return Condition("step", "step", float(level.mean()), light, FRAMES, "fit")


def _bars(name: str, speed: float, use: str) -> Condition:
    frame = np.arange(0.0, FRAMES, 20.0)
    where = np.arange(SHAPE[1])[None, None, :] - speed * frame[:, None, None]
    light = np.broadcast_to(0.2 + 0.15 * np.tanh(3 * np.sin(2 * np.pi * where / 12)), (frame.size, *SHAPE))
    return Condition(name, "moving", float(light.mean()), Keyframes(frame, light.astype(np.float32)), FRAMES, use)


@lru_cache
def recorded(effect: str | None, take: int) -> tuple[ObservedRecording, ...]:
    """One unit of scsim, with an effect or without, before all conditions; another take is other temporal noise."""
    model = MODEL.with_effect(CATALOGUE[effect](**EFFECTS[effect])) if effect else MODEL
    out = []
    for i, c in enumerate(conditions()):
        sensor = SpikeSensor(model, SHAPE, seed=3, engine="auto", take=100 * take + i)
        assert c.light is not None
        spikes = sensor.step(c.light if c.moves else c.light.radiance[0], FRAMES)
        out.append(observe(pack_frames(spikes), SHAPE, film=c.moves))
    return tuple(out)


FEW = ("dark", "flat-050", "flat-300", "flat-200")
"""Of the recordings, for pages whose pictures are as those of others."""


@lru_cache
def evidence(effect: str | None, *, named: bool = True, only: tuple[str, ...] = ()) -> Evidence:
    """Measured with the effect, model before without; model after with it, unless nothing was named.

    Args:
        effect: its name; None: no effect.
        named: whether the model after has it.
        only: names of recordings; else all.
    """
    kept = [i for i, c in enumerate(conditions()) if not only or c.name in only]
    shown = tuple(conditions()[i] for i in kept)

    def take(effect: str | None, number: int) -> tuple[ObservedRecording, ...]:
        return tuple(recorded(effect, number)[i] for i in kept)

    streams = [take(effect, 0), take(None, 1), take(effect, 2) if named and effect else None]
    bases = [free_refit(list(s), list(shown)) if s else None for s in streams]
    fresh = drawn_response(MODEL, bases[0], SHAPE, seed=11)  # type: ignore[arg-type]
    return Evidence(
        shown, *streams, *bases, again=take(None, 3), drawn_before=fresh, drawn_after=fresh if streams[2] else None
    )  # type: ignore[arg-type]


def statistics(loud: dict[str, float]) -> tuple[Statistic, ...]:
    """A bank: quiet but for the groups in `loud`, where z reaches the figure given; the others are quiet."""
    rng = np.random.default_rng(1)
    groups = ("rates", "noise", "intervals", "drift", "spectrum", "rows", "neighbours", "step", "moving", "pattern")
    names = [c.name for c in conditions()]
    out = []
    for group in groups:
        for i in range(8):
            quiet, left = rng.normal(size=2)
            z = quiet + loud.get(group, 0.0) * (1 if i < 3 else 0.2)
            out.append(
                Statistic(f"{group}.{i}", group, (names[(i + 1) % len(names)],), 1.0 + 0.01 * z, 1.0,
                          1.0 + 0.01 * (z - left), 0.01, z, left, min(1.0, 64 * 2 * np.exp(-(z**2) / 2)), i > 5)
            )  # fmt: skip
    return tuple(out)


def gap(before: float, after: float) -> Gap:
    """Gap over the two held-out recordings, floor 1."""
    parts = {
        "flat-200": {"before": 0.2 * before + 0.8, "after": 1.0, "floor": 1.0},
        "bars-fast": {"before": 1.8 * before - 0.8, "after": 2 * after - 1.0, "floor": 1.0},
    }
    return Gap(before, after, 1.0, (before - after) / (before - 1.0), parts)


def _plain(verdict: str, sentence: str, **others) -> Diagnosis:
    settings = {
        "effects": (), "unknown": None, "class_": None, "parameters": {}, "data": (), "gap": None,
        "statistics": statistics({}), "ranking": (), "bounds": (), "patched": MODEL, "model_name": "scsim",
        "not_testable": (("vignetting", "a uniform screen, measured: flats of known light at two positions"),
                         ("conversion_gain_spread", "nothing: it is free in the base refit")),
        "campaign": "camera-17", "seed": 7,
        "stages": {"audit": 0.4, "read": 1.2, "base refit": 3.1, "statistics": 9.8, "alarm": 0.2, "candidates": 31.5,
                   "gate": 12.0, "held-out": 5.5},
    } | others  # fmt: skip
    return Diagnosis(verdict=verdict, sentence=sentence, **settings)


def _ranking(best: str, parameters: dict[str, Estimate]) -> tuple[Ranked, ...]:
    family = {"photodiode_lag": "light", "dead_time": "saturation", "light_flicker": "light"}[best]
    return (
        Ranked(best, family, 6.3, 1.02, parameters, True, "passes the gate: its worst group is left with 1.4 sd"),
        Ranked("incomplete_reset", "reset", 6.3, 3.7, {"fraction": Estimate(0.021, 0.002)}, False,
               "leaves 11 sd in the step response"),
        Ranked("optical_blur", "optics", 6.3, 5.9, {"sigma_px": Estimate(0.31, 0.05)}, False,
               "leaves 38 sd in the step response"),
        Ranked("afterpulsing", "history", 6.3, 6.3, {"probability": Estimate(0.0, 0.001)}, False,
               "does not reduce the misfit"),
    )  # fmt: skip


def named(effect: str = "photodiode_lag", only: tuple[str, ...] = ()) -> Diagnosis:
    """One effect found, at its true value; `only` as of `evidence`."""
    values = {k: 1.02 * v for k, v in EFFECTS[effect].items()}
    found = estimates(effect, values, {k: 0.02 * abs(v) for k, v in EFFECTS[effect].items()})
    e = NamedEffect(effect, "light", 0.97, found, (("incomplete_reset", 0.02), ("optical_blur", 0.003)))
    loud = {"photodiode_lag": {"step": 38.0, "moving": 21.0}, "dead_time": {"rates": 44.0, "intervals": 12.0},
            "light_flicker": {"spectrum": 61.0, "drift": 30.0}}[effect]  # fmt: skip
    words = {
        "photodiode_lag": "Your camera has photodiode lag: 6.1 % of the charge comes late, with a tail of 1.2 ms; "
        "adding it removes 97 % of the gap on recordings that were not used.",
        "dead_time": "Your camera has a dead time of 1.02 us; adding it removes 98 % of the gap on recordings that "
        "were not used.",
        "light_flicker": "Your light flickers: 3.1 % at 102 Hz; adding it removes 97 % of the gap on recordings that "
        "were not used.",
    }
    model = replace(MODEL, name="scsim + " + effect).with_effect(
        CATALOGUE[effect](**{k: v.value for k, v in found.items()})
    )
    return _plain(
        "named", words[effect], degree=EXPLAINS_ALL, effects=(e,), gap=gap(41.0, 2.2), statistics=statistics(loud),
        ranking=_ranking(effect, found), patched=model, evidence=evidence(effect, only=only),
    )  # fmt: skip


def with_remainder() -> Diagnosis:
    """One effect found, whose law differs in details from the catalogue's."""
    left = Remainder(
        8.1, 0.0042, "step: up 16-32", {"step": 0.86, "moving": 0.14}, ("step", "bars"),
        ("the step of light", "moving light"), ("pixel by pixel", "a memory of earlier light"),
    )  # fmt: skip
    d = named()
    words = "Its law differs in details from the catalogue's: 0.4 % of the sum of squares is left."
    return replace(d, degree=EXPLAINS_NEARLY_ALL, remainder=left, sentence=f"{d.sentence} {words}")


def largest() -> Diagnosis:
    """One effect found, and something else beside it."""
    left = Remainder(
        40.2, 0.16, "rows: k1", {"rows": 0.9, "noise": 0.1}, ("flat-050",), ("the dim flats",),
        ("common to many pixels", "a coupling of neighbours"),
    )  # fmt: skip
    return replace(named(), degree=LARGEST, remainder=left, stand_ins=("crosstalk",))


def none() -> Diagnosis:
    """Nothing found, with bounds."""
    bounds = (Bound("dead_time", "tau_us", "us", 0.04), Bound("photodiode_lag", "fraction", "relative", 0.002),
              Bound("light_flicker", "modulation", "relative", 0.0007, {"frequency_hz": 2000.0}),
              Bound("crosstalk", "kick", "thresholds", 0.0011))  # fmt: skip
    return _plain(
        "none", "No gap: these recordings and the model scsim agree to within the noise.", bounds=bounds,
        bounds_kind="simulated", not_bounded=(("blooming", "longer recordings"),),
        gap=Gap(1.04, 1.04, 1.0, 0.0, {"flat-200": {"before": 1.02, "after": 1.02, "floor": 1.0},
                                       "bars-fast": {"before": 1.06, "after": 1.06, "floor": 1.0}}),
        evidence=evidence(None),
    )  # fmt: skip


def class_() -> Diagnosis:
    """Two names that these data cannot separate."""
    base = named("dead_time", FEW)
    members = ["photo_response_nonlinearity", "ir_drop"]
    return replace(
        base, verdict="class", effects=(),
        sentence="Your camera has a nonlinear response or an IR drop: these recordings do not show which; either "
        "removes 96 % of the gap.",
        class_={"members": members, "experiment": "Cover every second row and repeat the flat at level 0.6: IR drop "
                "halves, a nonlinearity stays."},
    )  # fmt: skip


def unknown() -> Diagnosis:
    """Real, and none of the candidates."""
    return _plain(
        "unknown", "Something is missing that no candidate explains: it needs light, is common to all pixels and has "
        "a line at 100 Hz.",
        unknown={"light": "needs light: nothing in the dark (z 0.4), all flats are off", "level_exponent": 1.02,
                 "extent": "common to all pixels", "time_scale_s": 0.01, "history": None, "neighbours": "none seen",
                 "where": "everywhere", "when": "throughout", "best_candidate": "lamp_drift",
                 "worst_group": "spectrum", "patch": "the waveform of the population, as an empirical modulation"},
        gap=gap(18.0, 4.5), statistics=statistics({"spectrum": 52.0, "noise": 9.0}),
        ranking=tuple(replace(r, accepted=False, reason="leaves 19 sd in spectrum; its gate is 4.2")
                      for r in _ranking("light_flicker", {"modulation": Estimate(0.02, 0.004)})),
        evidence=evidence("light_flicker", named=False),
    )  # fmt: skip


def parameter() -> Diagnosis:
    """An effect that is present is off."""
    return _plain(
        "parameter", "No effect is missing, but shot noise is off: 31000 electrons fit, the model has 50000.",
        parameters={"shot_noise": {"measured": 31000.0, "nominal": 50000.0, "ratio": 0.62}},
        gap=gap(9.0, 1.2), statistics=statistics({"noise": 17.0}), evidence=evidence("dead_time", only=FEW),
    )  # fmt: skip


def data() -> Diagnosis:
    """Labels that contradict the recordings."""
    return _plain(
        "data", "The data contradict their own labels: flat-300 is 2.1 % brighter than its label says.",
        data=("flat-300: rates are 2.1 % (31 sd) above the line through the other flats; its label fits 0.3063",
              "flat-050 and flat-120: consistent with their labels"),
        statistics=statistics({"rates": 31.0}),
        evidence=evidence("dead_time", named=False, only=FEW),
    )  # fmt: skip


EVERY = {
    "none": none,
    "named": named,
    "class": class_,
    "unknown": unknown,
    "parameter": parameter,
    "data": data,
}
"""A diagnosis of each verdict, made when asked for."""
