"""Files by chance: whatever bytes or structure a reader meets, it reads them or raises InputError."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mutations import npz
from tally import reads_or_refuses

from spikecam_env.campaign.flat_maps import read_flat_maps
from spikecam_env.campaign.labels import labels_from_table
from spikecam_env.campaign.reading import read_campaign, read_light, read_rates
from spikecam_env.datasets.manifest import Manifest
from spikecam_env.sensor import SensorModel
from spikecam_env.streams import read_recording
from spikecam_env.untrusted import array_names, read_arrays, read_json, read_toml

MANY = settings(
    max_examples=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)

READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "campaign.json": ("campaign.json", lambda path: read_campaign(path.parent)),
    "dataset.json": ("dataset.json", lambda path: Manifest.read(path.parent)),
    "any JSON": ("x.json", read_json),
    "any TOML": ("x.toml", read_toml),
    "model": ("x.toml", SensorModel.from_toml),
    "labels": ("x.csv", labels_from_table),
    "any npz": ("x.npz", read_arrays),
    "names of an npz": ("x.npz", array_names),
    "light": ("x.npz", lambda path: read_light(path, "light")),
    "rates": ("x.npz", lambda path: read_rates(path, "rates")),
    "flat maps": ("x.npz", read_flat_maps),
    "spikes in an npz": ("x.npz", read_recording),
    "spikes in an h5": ("x.h5", read_recording),
    "spikes in a dat": ("x.dat", lambda path: read_recording(path, height=8, width=8)),
}
FORMATS = ("spikecam-campaign/1", "spikecam-dataset/1", "spikecam-model/1", "spikecam-recording/1")
KEYS = ("format", "camera", "height", "width", "frame_rate_hz", "recordings", "name", "spikes", "rates", "frames",
        "radiance", "use", "settings", "files", "path", "bytes", "sha256", "circuit", "effect", "x")  # fmt: skip
TEXTS = st.one_of(st.sampled_from((*FORMATS, *KEYS, "fit", "dead_time", "../x", "/etc/passwd")), st.text(max_size=8))
NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from((0, 1, -1, 8, 2**63, 10**400, 1e308)))
STRUCTURES = st.recursive(
    st.one_of(st.none(), st.booleans(), NUMBERS, TEXTS),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.sampled_from(KEYS), inner, max_size=6)),
    max_leaves=12,
)
DTYPES = st.one_of(
    hnp.boolean_dtypes(),
    hnp.integer_dtypes(),
    hnp.unsigned_integer_dtypes(),
    hnp.floating_dtypes(sizes=(16, 32, 64)),
    hnp.complex_number_dtypes(),
    hnp.byte_string_dtypes(max_len=4),
    hnp.unicode_string_dtypes(max_len=4),
    hnp.datetime64_dtypes(),
)
ARRAYS = hnp.arrays(DTYPES, hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5))
NAMES = st.sampled_from(
    ("spikes", "seq", "length", "time_axis", "frame", "radiance", "rate", "frames", "D_light", "Nd")
)


@pytest.mark.parametrize("target", READERS)
def test_any_bytes(target: str, tmp_path: Path) -> None:
    name, read = READERS[target]

    @MANY
    @given(st.binary(max_size=300))
    def check(data: bytes) -> None:
        (tmp_path / name).write_bytes(data)
        reads_or_refuses(f"{target} (by chance)", lambda: read(tmp_path / name))

    check()


@pytest.mark.parametrize("target", ["campaign.json", "dataset.json", "model"])
def test_any_structure(target: str, tmp_path: Path) -> None:
    name, read = READERS[target]

    @MANY
    @given(st.dictionaries(st.sampled_from(KEYS), STRUCTURES, max_size=8), st.sampled_from(FORMATS))
    def check(data: dict[str, Any], format: str) -> None:
        with suppress(TypeError, ValueError):  # TOML has no null, and JSON no lone surrogates
            text = (
                tomli_w.dumps({**data, "format": format})
                if target == "model"
                else json.dumps({**data, "format": format})
            )
            (tmp_path / name).write_bytes(text.encode("utf-8", "replace"))
        if (tmp_path / name).exists():
            reads_or_refuses(f"{target} (by chance)", lambda: read(tmp_path / name))

    check()


@pytest.mark.parametrize("target", ["any npz", "light", "rates", "flat maps", "spikes in an npz"])
def test_any_arrays(target: str, tmp_path: Path) -> None:
    name, read = READERS[target]

    @MANY
    @given(st.dictionaries(NAMES, ARRAYS, max_size=5))
    def check(arrays: dict[str, np.ndarray]) -> None:
        (tmp_path / name).write_bytes(npz(arrays))
        reads_or_refuses(f"{target} (by chance)", lambda: read(tmp_path / name))

    check()


@MANY
@given(
    ARRAYS.filter(lambda array: array.dtype.kind in "biufcS"),
    st.dictionaries(
        st.sampled_from(KEYS), st.one_of(st.booleans(), st.integers(0, 2**62), st.floats(), TEXTS), max_size=4
    ),
    st.sampled_from((None, 4, 8)),
)
def test_any_hdf5(tmp_path: Path, spikes: np.ndarray, attributes: dict[str, Any], side: int | None) -> None:
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file["spikes"] = spikes
        for name, value in attributes.items():
            with suppress(ValueError, UnicodeEncodeError):  # NUL and lone surrogates
                file.attrs[name] = value
        file.attrs["format"] = "spikecam-recording/1"
        if side is not None:
            file.attrs["height"] = file.attrs["width"] = side
    reads_or_refuses("spikes in an h5 (by chance)", lambda: read_recording(path))


@MANY
@given(st.lists(st.lists(TEXTS, max_size=5), max_size=4))
def test_any_table(tmp_path: Path, rows: list[list[str]]) -> None:
    path = tmp_path / "x.csv"
    lines = ["file,radiance,name,height", *(",".join(row) for row in rows)]
    path.write_text("\n".join(lines), encoding="utf-8", errors="replace")
    reads_or_refuses("labels (by chance)", lambda: labels_from_table(path))
