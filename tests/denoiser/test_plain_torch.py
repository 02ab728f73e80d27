"""Checkpoints from outside: damaged, hostile or odd ones are an InputError, never another error or other weights."""

from __future__ import annotations

import io
import pickle
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from denoiser.ground.plain_torch import read_plain
from denoiser.passes.recipe import RECIPES, Recipe
from denoiser.weights import digest, load_weights, pretrained_path, save_weights, seal
from spikecam_env.errors import InputError

QUICK = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "best.pt"
    torch.manual_seed(0)
    save_weights(path, "best", RECIPES["best"], RECIPES["best"].network(), {"steps": 3})
    return path


def changed(whole: Path, path: Path, change: Any) -> Path:
    """A copy of a checkpoint after `change(data)`, with a digest that fits where there can be one."""
    data = torch.load(whole, weights_only=True)
    data = change(data) or data
    if isinstance(data, dict):
        try:
            data["sha256"] = digest(Recipe.from_dict(data["recipe"]), data["state_dict"])
        except Exception:
            data["sha256"] = "none"
    torch.save(data, path)
    return path


def of_layout(**entries: Any) -> Any:
    return lambda data: data["recipe"]["layout"].update(entries)


def of_recipe(**entries: Any) -> Any:
    return lambda data: data["recipe"].update(entries)


def of_weights(make: Any) -> Any:
    name = "out.bias"
    return lambda data: data["state_dict"].update({name: make(data["state_dict"][name])})


def fill(value: float) -> Any:
    def change(data: Any) -> None:
        for tensor in data["state_dict"].values():
            tensor.fill_(value)

    return change


def deep(levels: int) -> list[Any]:
    nested: list[Any] = []
    for _ in range(levels):
        nested = [nested]
    return nested


ODD: dict[str, Any] = {
    "a list": lambda data: [1, 2],
    "text": lambda data: "weights",
    "no recipe": lambda data: data.pop("recipe") and None,
    "recipe None": lambda data: data.update(recipe=None),
    "recipe a list": lambda data: data.update(recipe=[1]),
    "recipe nested": of_recipe(layout=deep(50)),
    "unknown entry": of_recipe(width=3),
    "text for planes": of_layout(planes="8"),
    "huge planes": of_layout(planes=10**9),
    "a number of 400 digits": of_layout(past=10**400),
    "negative past": of_layout(past=-1),
    "half a frame": of_layout(future=20.5),
    "true future": of_layout(future=True),
    "negative half width": of_layout(half_widths=(-4,)),
    "many half widths": of_layout(half_widths=tuple(range(10_000))),
    "text for memories": of_layout(memories="long"),
    "NaN memory": of_layout(memories=(float("nan"), 512.0)),
    "zero memory": of_layout(memories=(0.0, 512.0)),
    "infinite gain memory": of_layout(gain_memory=float("inf")),
    "half a gain memory": of_layout(gain_memory=0.5),
    "unknown decoder": of_recipe(decoder="os.system"),
    "decoder a list": of_recipe(decoder=["mus"]),
    "unknown target": of_recipe(target=None),
    "refine a number": of_recipe(refine=2),
    "no weights": lambda data: data.pop("state_dict") and None,
    "weights a list": lambda data: data.update(state_dict=[torch.zeros(3)]),
    "a weight less": lambda data: data["state_dict"].pop("out.bias") is None or None,
    "a weight more": lambda data: data["state_dict"].update(extra=torch.zeros(2)),
    "all NaN": fill(float("nan")),
    "infinite": of_weights(lambda t: t.fill_(float("inf"))),
    "one NaN": of_weights(lambda t: torch.where(torch.arange(len(t)) == 1, float("nan"), t)),
    "float64": of_weights(lambda t: t.double()),
    "bfloat16": of_weights(lambda t: t.bfloat16()),
    "complex": of_weights(lambda t: t.to(torch.complex64)),
    "whole numbers": of_weights(lambda t: t.to(torch.int64)),
    "sparse": of_weights(lambda t: t.to_sparse()),
    "quantised": of_weights(lambda t: torch.quantize_per_tensor(t, 0.1, 0, torch.qint8)),
    "another shape": of_weights(lambda t: t[:-1]),
    "another axis": of_weights(lambda t: t[None]),
    "one value for all": of_weights(lambda t: t[:1].expand(10**6)),
    "a number for a tensor": of_weights(lambda t: 0.5),
    "training a list": lambda data: data.update(training=[1]),
}


@pytest.mark.filterwarnings("ignore:.*(quantiz|Sparse|sparse)")
@pytest.mark.parametrize("name", ODD)
def test_an_odd_checkpoint_is_an_input_error_in_one_line(whole: Path, tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError) as caught:
        load_weights(changed(whole, tmp_path / "odd.pt", ODD[name]))
    print(caught.value)
    assert "odd.pt" in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 500


def rewritten(whole: Path, path: Path, change: Any, **options: Any) -> Path:
    """A copy with other records, their sums right."""
    with zipfile.ZipFile(whole) as archive:
        records = {info.filename: archive.read(info) for info in archive.infolist()}
    change(records)
    with zipfile.ZipFile(path, "w", **options) as archive:
        for name, content in records.items():
            archive.writestr(name, content)
    return path


def test_a_tensor_that_is_declared_larger_than_its_record_is_refused(whole: Path, tmp_path: Path) -> None:
    """torch.load believes the number in the file, and reads the memory behind it."""

    class Pickler(pickle.Pickler):
        def persistent_id(self, value: Any) -> Any:
            return value if isinstance(value, tuple) and value[:1] == ("storage",) else None

    class Declares:
        def __init__(self, *arguments: Any) -> None:
            self.arguments = arguments

        def __reduce__(self) -> Any:
            return torch._utils._rebuild_tensor_v2, self.arguments

    storage = ("storage", torch.FloatStorage, "0", "cpu", 10**12)
    shapes = [((10**12,), (1,)), ((10**6, 10**6), (0, 0)), ((2,), (10**15,)), ((-1,), (1,)), ((1,), (-1,))]
    for count, (shape, strides) in ((n, s) for n in (10**12, 4) for s in shapes):
        content = io.BytesIO()
        Pickler(content, protocol=2).dump({"format": Declares((*storage[:4], count), 0, shape, strides)})
        path = tmp_path / "giant.pt"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("giant/data.pkl", content.getvalue())
            archive.writestr("giant/data/0", np.zeros(4, np.float32).tobytes())
        with pytest.raises(InputError, match=r"giant\.pt"):
            read_plain(path)


@pytest.mark.parametrize(
    "content",
    [pickle.dumps(print), pickle.dumps(Path("x")), b"cos\nsystem\n(S'true'\ntR.", b"r\xff\xff\xff\x7f.", b"", b"."],
    ids=["a function", "a class", "a command", "a giant memo", "nothing", "stop"],
)
def test_a_pickle_of_more_than_plain_values_is_refused(whole: Path, tmp_path: Path, content: bytes) -> None:
    def change(records: dict[str, bytes]) -> None:
        records[next(name for name in records if name.endswith("data.pkl"))] = content

    with pytest.raises(InputError, match=r"foreign\.pt"):
        read_plain(rewritten(whole, tmp_path / "foreign.pt", change))


def test_a_compressed_or_reordered_file_is_refused(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="compressed"):
        read_plain(rewritten(whole, tmp_path / "a.pt", lambda records: None, compression=zipfile.ZIP_DEFLATED))
    with pytest.raises(InputError, match="little-endian"):
        read_plain(rewritten(whole, tmp_path / "b.pt", lambda records: records.update({"best/byteorder": b"big"})))


def loads_equal_or_refuses(path: Path, expected: dict[str, torch.Tensor]) -> bool:
    """Whether it loads; then to these weights."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            weights = load_weights(path)[1].state_dict()
    except InputError:
        return False
    assert all(torch.equal(weights[name], expected[name]) for name in expected)
    return True


@QUICK
@given(changes=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=3))
def test_changed_bytes_are_refused_or_change_no_weight(whole: Path, tmp_path: Path, changes: Any) -> None:
    expected = torch.load(whole, weights_only=True)["state_dict"]
    content = bytearray(whole.read_bytes())
    for place, change in changes:
        content[int(place * len(content))] ^= change
    path = tmp_path / "changed.pt"
    path.write_bytes(content)
    loads_equal_or_refuses(path, expected)


@QUICK
@given(place=st.integers(0, 40_000), change=st.integers(1, 255), tail=st.booleans())
def test_changed_bytes_where_the_structure_is_are_refused_too(
    whole: Path, tmp_path: Path, place: int, change: int, tail: bool
) -> None:
    """The pickle begins the file, the directory ends it."""
    expected = torch.load(whole, weights_only=True)["state_dict"]
    content = bytearray(whole.read_bytes())
    content[-1 - place if tail else place] ^= change
    path = tmp_path / "changed.pt"
    path.write_bytes(content)
    loads_equal_or_refuses(path, expected)


@QUICK
@given(content=st.binary(max_size=300))
def test_any_bytes_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "any.pt"
    path.write_bytes(content)
    with pytest.raises(InputError):
        load_weights(path)


@QUICK
@given(content=st.binary(max_size=300))
def test_any_pickle_is_refused(whole: Path, tmp_path: Path, content: bytes) -> None:
    """Inside a file whose sums are right."""
    path = tmp_path / "any.pt"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("any/data.pkl", content)
    with pytest.raises(InputError):
        load_weights(path)


def test_three_changed_bytes_of_a_weight_are_refused_though_the_sums_are_right(whole: Path, tmp_path: Path) -> None:
    def change(records: dict[str, bytes]) -> None:
        name = next(name for name in records if "/data/" in name)
        records[name] = bytes([*(byte ^ 1 for byte in records[name][:3]), *records[name][3:]])

    with pytest.raises(InputError, match="not those of its digest"):
        load_weights(rewritten(whole, tmp_path / "a.pt", change))


def test_a_checkpoint_without_a_digest_loads_with_a_warning_and_can_be_sealed(whole: Path, tmp_path: Path) -> None:
    data = torch.load(whole, weights_only=True)
    del data["sha256"]
    path = tmp_path / "old.pt"
    torch.save(data, path)
    with pytest.warns(UserWarning, match=r"old\.pt has no digest"):
        load_weights(path)
    seal(path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert loads_equal_or_refuses(path, data["state_dict"])


@pytest.mark.parametrize("mode", sorted(RECIPES))
def test_shipped_weights_are_sealed_and_read_as_torch_reads_them(mode: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, network, _ = load_weights(pretrained_path(mode))
    expected = torch.load(pretrained_path(mode), weights_only=True)["state_dict"]
    assert all(torch.equal(tensor, expected[name]) for name, tensor in network.state_dict().items())
