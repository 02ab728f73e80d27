"""The real recordings: they lie beside the checkout, and are not ours to pass on."""

from pathlib import Path

REAL = Path(__file__).resolve().parents[2] / "shared" / "data" / "real"
