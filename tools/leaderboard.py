"""The table of docs/leaderboard.md, of the entries in docs/leaderboard/: `python -m tools.leaderboard` writes it."""

from __future__ import annotations

from pathlib import Path

from spikecam_env.agents.leaderboard import leaderboard, read_entries
from spikecam_env.cli.table import markdown
from spikecam_env.whole import write_text_whole

PAGE = Path(__file__).parents[1] / "docs" / "leaderboard.md"
ENTRIES = PAGE.with_suffix("")
START, STOP = "<!-- table -->", "<!-- end of table -->"


def with_table(page: str, entries: Path = ENTRIES) -> str:
    """The page with the table of the entries in a folder."""
    head, _, rest = page.partition(START)
    _, _, tail = rest.partition(STOP)
    return f"{head}{START}\n\n{markdown(leaderboard(read_entries(entries)))}\n\n{STOP}{tail}"


if __name__ == "__main__":
    write_text_whole(PAGE, with_table(PAGE.read_text("utf-8")))
