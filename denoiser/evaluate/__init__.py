"""How good the denoiser is.

work.py         the one runner: rows of cases are exposed, made (`rows.py`) and judged; records are saved as they come
quick.py        held-out scenes by simulation: `spikecam evaluate quick`
tables.py       the paper's tables and scenes at rest: `spikecam evaluate table1` to `table4`, `still`
measures.py     the tables' measures of rates against light, as pure functions
flow.py         optical flow from pictures, and of others' files: `spikecam evaluate flow`
spikezoo.py     clips in Spike-Zoo's layout, by its protocol: `spikecam evaluate spikezoo`
truth.py        the truth tests: `spikecam evaluate truth`, of `halves.py`, `fixed_pattern.py` and `quick.py`
"""

from denoiser.evaluate.held_out import HELD_OUT_KINDS, held_out_textures
from denoiser.evaluate.quick import PICTURES, evaluate_quick, report

__all__ = ["HELD_OUT_KINDS", "PICTURES", "evaluate_quick", "held_out_textures", "report"]
