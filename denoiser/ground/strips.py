"""Work on pictures, shared among as many threads as torch has, a strip of rows at a time."""

from __future__ import annotations

from collections.abc import Callable

import torch

from spikecam_env.threads import as_many_as_pay, share_out

ROWS = 16
"""Rows that a thread takes at a time."""


def share_rows(work: Callable[[int, slice], None], pictures: int, height: int, size: int) -> None:
    """Call work(picture, rows) for all strips of all pictures of `height` rows, in any order; size: numbers in all."""
    strips = -(-height // ROWS)

    def strip(number: int) -> None:
        picture, at = divmod(number, strips)
        work(picture, slice(ROWS * at, min(ROWS * (at + 1), height)))

    count = pictures * strips
    share_out(strip, count, as_many_as_pay(torch.get_num_threads(), count, size))
