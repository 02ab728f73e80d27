"""The moving picture of README and of the site's first page: the film of `spikecam demo`, smaller.

python -m tools.demo_picture    # docs/demo.webp; two minutes
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import av
from PIL import Image

from spikecam_env.errors import InputError
from spikecam_env.whole import whole_file

PICTURE = Path(__file__).parents[1] / "docs/demo.webp"
WIDTH = 900
"""Of the picture [pixels]: as wide as a page shows it."""
QUALITY = 55
"""Of WebP, 0 to 100: grain of the noisy part is most of the file."""
LARGEST = 3_000_000
"""Largest file [bytes], so that a page loads at once."""


def read_film(path: Path) -> tuple[list[Image.Image], float]:
    """Pictures of a film, and pictures a second."""
    with av.open(str(path)) as film:
        rate = film.streams.video[0].average_rate
        if rate is None:
            raise InputError(f"{path} states no rate of pictures")
        return [frame.to_image() for frame in film.decode(video=0)], float(rate)


def write_webp(path: Path, pictures: list[Image.Image], ms: float) -> None:
    """Write a moving picture.

    Args:
        path: of the file, which appears whole.
        pictures: of one size.
        ms: time of a picture [ms].

    Raises:
        InputError: where the file is larger than LARGEST.
    """
    first, *others = pictures
    with whole_file(path) as beside:
        first.save(
            beside,
            format="WEBP",
            save_all=True,
            append_images=others,
            duration=round(ms),
            loop=0,
            quality=QUALITY,
            method=6,
        )
        if beside.stat().st_size > LARGEST:
            raise InputError(f"the picture has {beside.stat().st_size} bytes; {LARGEST} are the most: lower QUALITY")


def main() -> None:
    """Run the demo, and write its film as an animated WebP."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "spikecam_env", "demo", "--no-open", "--out", folder], check=True)
        pictures, rate = read_film(Path(folder, "demo.mp4"))
    size = (WIDTH, round(WIDTH * pictures[0].height / pictures[0].width))
    write_webp(PICTURE, [picture.resize(size, Image.Resampling.LANCZOS) for picture in pictures], 1000 / rate)
    print(f"{PICTURE.name}: {len(pictures)} pictures of {size[0]} x {size[1]}, {PICTURE.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
