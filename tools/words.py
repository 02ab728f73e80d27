"""Sentences of the code: short ones, that name the thing.  `make lint` runs this.

python -m tools.words [PATH ...]     lists them; exit status 1 where a share is over its limit
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("spikecam_env", "scenes", "denoiser", "benchmarks", "tools", "tests")
WORDS = 30
"""Longest sentence [words]."""
LIMITS = {"what": 0.005, "long": 0.002}
"""Largest shares of sentences."""
SENTENCE_END = re.compile(r"(?<=[.;:?!])\s+|\n\s*\n")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


def texts(source: str) -> Iterator[tuple[int, str]]:
    """Docstrings, other strings and blocks of comments of a module, each with its first line."""
    tree = ast.parse(source)
    pieces = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield node.lineno, "".join(str(p.value) if isinstance(p, ast.Constant) else "X" for p in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in pieces:
            yield node.lineno, re.sub(r"(?m)^\s*(>>>|\.\.\. ).*$", "\n", node.value)
    block: list[tokenize.TokenInfo] = []
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            block.append(token)
        elif token.type not in (tokenize.NL, tokenize.NEWLINE) and block:
            yield block[0].start[0], "\n".join(part.string.lstrip("# ") for part in block)
            block = []


def sentences(source: str) -> Iterator[tuple[int, str]]:
    """Every sentence of three words or more, with the line on which its text begins."""
    for line, text in texts(source):
        yield from ((line, " ".join(part.split())) for part in SENTENCE_END.split(text) if len(part.split()) > 2)


def faults(sentence: str) -> list[str]:
    """The limits that a sentence counts for.

    Example:
        >>> faults("It returns what it was given.")
        ['what']
    """
    what = re.search(r"\bwhat\b", sentence, re.IGNORECASE) and "?" not in sentence
    return ["what"] * bool(what) + ["long"] * (len(sentence.split()) > WORDS)


def main(paths: list[str]) -> int:
    files = [
        file
        for path in paths or PACKAGES
        for file in sorted([Path(path)] if path.endswith(".py") else Path(path).rglob("*.py"))
    ]
    count, found = 0, dict.fromkeys(LIMITS, 0)
    for file in files:
        for line, sentence in sentences(file.read_text(encoding="utf-8")):
            count += 1
            for fault in faults(sentence):
                found[fault] += 1
                print(f"{file}:{line}: {fault}: {sentence}")
    shares = {fault: number / max(count, 1) for fault, number in found.items()}
    print(
        ", ".join(f"{fault} {100 * share:.2f} % (limit {100 * LIMITS[fault]:.1f})" for fault, share in shares.items())
    )
    return int(any(share > LIMITS[fault] for fault, share in shares.items()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
