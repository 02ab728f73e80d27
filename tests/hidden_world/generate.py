"""A campaign by hand.

python -m tests.hidden_world.generate --mechanism dead_time --times-limit 5 --seed 1 --out DIR
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from tests.hidden_world.mechanism import draw
from tests.hidden_world.tricky import TRICKS
from tests.hidden_world.unit import BASES
from tests.hidden_world.world import MECHANISMS, Recipe, stream, write_campaign


def main(arguments: list[str] | None = None) -> None:
    """Write one campaign, and beside it (never in it) DIR.key.json with its key."""
    parser = argparse.ArgumentParser(description=__doc__)
    known = sorted(
        f"{m.name}/{law.name}" if law is not m else m.name for m in MECHANISMS.values() for law in (m, *m.far)
    )
    words = {"choices": known, "metavar": "NAME[/LAW]", "help": "by its near law or a far one; may be repeated"}
    parser.add_argument("--mechanism", action="append", default=[], **words)
    parser.add_argument("--times-limit", type=float, default=5.0, help="strength over its detection limit")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--base", choices=sorted(BASES), default="scsim")
    parser.add_argument("--trick", choices=sorted(TRICKS), default="")
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--frames", type=int, default=8000)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    hidden = tuple(
        draw(MECHANISMS[name], options.times_limit, stream(options.seed, name, "shape"), law)
        for name, _, law in (word.partition("/") for word in options.mechanism)
    )
    shape = (options.size, options.size)
    recipe = Recipe(options.seed, options.base, hidden, options.trick, shape=shape, frames=options.frames)
    began = time.perf_counter()
    drawn = write_campaign(recipe, options.out)
    key = {"hidden": [{"name": h.name, "law": h.law, "parameters": h.parameters} for h in hidden], "unit": drawn}
    text = json.dumps(key, indent=1)
    options.out.with_name(options.out.name + ".key.json").write_text(text + "\n", encoding="utf-8")
    print(text)
    print(f"wrote {options.out} in {time.perf_counter() - began:.1f} s")


if __name__ == "__main__":
    main()
