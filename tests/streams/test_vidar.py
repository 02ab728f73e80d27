from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from spikecam_env.errors import InputError
from spikecam_env.streams import load_vidar_dat, middleTFP, save_vidar_dat

SHARED = Path(__file__).parents[2].parent / "shared" / "data"


@pytest.fixture
def spikes() -> np.ndarray:
    return np.random.default_rng(1).integers(0, 2, (9, 6, 12), dtype=np.uint8)


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("order", ["little", "big"])
def test_load_undoes_save(tmp_path: Path, spikes: np.ndarray, flip: bool, order: str) -> None:
    path = tmp_path / "a.dat"
    save_vidar_dat(path, spikes, flip=flip, bit_order=order)
    assert path.stat().st_size == 9 * 6 * 12 // 8
    options = {"height": 6, "width": 12, "flip": flip, "bit_order": order}
    np.testing.assert_array_equal(load_vidar_dat(path, **options), spikes)
    np.testing.assert_array_equal(load_vidar_dat(path, first=3, count=4, **options), spikes[3:7])


def test_flip_turns_rows_upside_down(tmp_path: Path, spikes: np.ndarray) -> None:
    save_vidar_dat(tmp_path / "a.dat", spikes)
    turned = load_vidar_dat(tmp_path / "a.dat", height=6, width=12, flip=True)
    np.testing.assert_array_equal(turned, spikes[:, ::-1])


def test_crop_keeps_the_left_columns(tmp_path: Path, spikes: np.ndarray) -> None:
    save_vidar_dat(tmp_path / "a.dat", spikes)
    cropped = load_vidar_dat(tmp_path / "a.dat", height=6, width=12, crop_width=10)
    np.testing.assert_array_equal(cropped, spikes[:, :, :10])


def test_size_that_does_not_divide_is_refused_with_what_would(tmp_path: Path) -> None:
    path = tmp_path / "b.dat"
    path.write_bytes(bytes(3 * 13000))
    with pytest.raises(InputError, match=r"39000 bytes.* 12500 bytes a frame, remainder 1500.*250 x 416"):
        load_vidar_dat(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="0 bytes"):
        load_vidar_dat(path)


def test_frames_and_files_that_are_not_there_are_refused(tmp_path: Path, spikes: np.ndarray) -> None:
    save_vidar_dat(tmp_path / "a.dat", spikes)
    with pytest.raises(InputError, match="holds 9"):
        load_vidar_dat(tmp_path / "a.dat", height=6, width=12, first=5, count=5)
    with pytest.raises(InputError, match="crop_width is 13"):
        load_vidar_dat(tmp_path / "a.dat", height=6, width=12, crop_width=13)
    with pytest.raises(InputError, match="no file"):
        load_vidar_dat(tmp_path / "none.dat")
    with pytest.raises(InputError, match="no folder"):
        save_vidar_dat(tmp_path / "none" / "a.dat", spikes)


def test_failed_save_leaves_the_old_file(tmp_path: Path, spikes: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.dat"
    save_vidar_dat(path, spikes)

    def fail(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("spikecam_env.whole.os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save_vidar_dat(path, 1 - spikes)
    assert [p.name for p in tmp_path.iterdir()] == ["a.dat"]
    np.testing.assert_array_equal(load_vidar_dat(path, height=6, width=12), spikes)


@pytest.mark.skipif(not SHARED.is_dir(), reason="needs the shared data folder")
def test_public_vidar_file_is_upright_when_flipped() -> None:
    cv2 = pytest.importorskip("cv2")
    truth = cv2.imread(str(SHARED / "synthetic" / "reds_200_part1_frame151.png"), cv2.IMREAD_GRAYSCALE) / 255
    as_stored, flipped = (
        middleTFP(load_vidar_dat(SHARED / "synthetic" / "reds_200_part1.dat", flip=flip), 151) for flip in (False, True)
    )
    upright, wrong = (np.corrcoef(p.ravel(), truth.ravel())[0, 1] for p in (flipped, as_stored))
    ratio = flipped.mean() / truth.mean()
    print(f"correlation with the true picture: flipped {upright:.3f}, as stored {wrong:.3f}; rate/light {ratio:.3f}")
    assert upright > 0.98 and wrong < 0.1
    assert ratio == pytest.approx(0.600, abs=0.002)
