"""Runs the blocks of a page: Python in one namespace, command lines in one folder, in the order of the page."""

from __future__ import annotations

import argparse
import functools
import inspect
import os
import re
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from runpy import run_path
from types import ModuleType
from typing import Any

import tyro
from page_sizes import BROUGHT, ONLY_READ, SMALL
from pytest import MonkeyPatch

from spikecam_env.cli.main import run, understood
from spikecam_env.cli.options import check_options
from spikecam_env.errors import InputError
from tools.page_blocks import COMMANDS, PYTHON, ROOT, Block, command_lines

INSTALLED = f"{sys.executable} -m spikecam_env"
ENVIRONMENT = re.compile(r"^[A-Z_]+=\S+ ")
SHELL = ("mkdir", "cp", "mv", "ls", "cat")
"""Other programs than `spikecam` and `python` that a page may run in its folder."""


@dataclass
class Page:
    """A page as it is run.  module: its Python's namespace.  counts: blocks and lines that were run, or not and why."""

    module: ModuleType
    patch: MonkeyPatch
    counts: Counter[str] = field(default_factory=Counter)

    def do(self, block: Block, instead: str = "") -> None:
        """Run a block; or only read it, where it says so or `instead` does, a reason."""
        if instead:
            block = replace(block, marks={"not run": instead})
        self.bring(block.code)
        if "given" in block.marks:
            self.python(block.marks["given"], block.line)
        if "file" in block.marks:
            Path(block.marks["file"]).write_text(block.code, encoding="utf-8")
        elif block.kind == PYTHON:
            self._python_block(block)
        elif block.kind == COMMANDS:
            for line in command_lines(block.small):
                self._line(line, block)

    def bring(self, code: str) -> None:
        """Make the files that the block names, that a reader brings and that the folder does not hold yet.

        Files that a line of the block makes (`--out NAME`) are not brought.
        """
        for name, make in BROUGHT.items():
            if re.search(rf"(?<![\w./-])(?<!--out ){re.escape(name)}(?![\w-])", code) and not Path(name).exists():
                make(Path(name))

    def python(self, code: str, line: int) -> None:
        exec(compile("\n" * (line - 1) + code, self.module.__name__, "exec"), self.module.__dict__)

    def environment(self, line: str) -> None:
        """Set the variables that a line sets before its program."""
        for word in ENVIRONMENT.findall(line):
            self.patch.setenv(*word.strip().split("="))

    def _python_block(self, block: Block) -> None:
        if "not run" in block.marks:
            compile(block.code, self.module.__name__, "exec")
            self.counts[f"Python blocks not run: {block.marks['not run']}"] += 1
            return
        self.python(block.small, block.line)
        self.counts["Python blocks run"] += 1

    def _line(self, line: str, block: Block) -> None:
        words = words_of(line)
        reason = block.marks.get("not run") or ("" if block.options else reason_not_to_run(words))
        if words[0] == "spikecam" and not reason:
            words = [*without(words, block.options), *block.options]
            words = [*words, *at_small_size(words)]
            self.environment(line)
            assert run(words[1:]) == 0, shlex.join(words)
        elif reason:
            read(line)
        else:
            in_shell(line)
        self.counts[f"command lines not run: {reason}" if reason else "command lines run"] += 1


def words_of(line: str) -> list[str]:
    """The words of a line, from its program on; one of `.venv/bin` by its name."""
    program, *words = shlex.split(ENVIRONMENT.sub("", line))
    return [program.removeprefix(".venv/bin/"), *words]


def reason_not_to_run(words: Sequence[str]) -> str:
    """Why a line is only read; empty where it is run."""
    if words[0] == "spikecam":
        return next((why for command, why in ONLY_READ.items() if begins(words[1:], command)), "")
    if words[0] == "python" and words[1:3] == ["-m", "pytest"]:
        return "" if all(Path(word).exists() for word in words[3:4]) else "the repository's own tests"
    if words[0] == "python":
        return "a program of the checkout, for minutes or hours"
    return "" if words[0] in SHELL else f"{words[0]}: sets up or serves"


def at_small_size(words: Sequence[str]) -> list[str]:
    """Options that make a command small, those apart that the line gives, and those that have no effect in it."""
    added: list[str] = []
    for command, options in SMALL.items():
        if begins(words[1:], command):
            for option in re.findall(r"--\S+(?: (?!--)\S+)*", options):
                added += [] if option.split()[0] in words or not has_effect(words, option) else option.split()
    return added


def has_effect(words: Sequence[str], option: str) -> bool:
    """Whether a line of `spikecam` takes an option."""
    try:
        understood([*words[1:], *option.split()])
    except InputError:
        return False
    return True


def without(words: Sequence[str], options: Sequence[str]) -> list[str]:
    """The words less those options, and their values, that are given anew."""
    kept: list[str] = []
    dropped = False
    for word in words:
        dropped = word in options if word.startswith("--") else dropped
        kept += [] if dropped else [word]
    return kept


def begins(words: Sequence[str], command: str) -> bool:
    return list(words[: len(command.split())]) == command.split()


def read(line: str) -> None:
    """Read a command line with its own parser, and run nothing; raises where it is not understood."""
    words = words_of(line)
    if words[0] == "spikecam":
        check_options(understood(words[1:]))
    elif words[:2] == ["python", "-m"] and words[2].split(".")[0] in ("benchmarks", "tools"):
        if not words[2].endswith(".NAME"):
            read_program(words[2], words[3:])
    elif words[0] == "make":
        for target in (word for word in words[1:] if "=" not in word):  # and no variable
            assert f"\n{target}:" in (ROOT / "Makefile").read_text(encoding="utf-8"), f"no target {target}"
    else:
        done = subprocess.run(["bash", "-n", "-c", line], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


class Understood(BaseException):
    """A program has read its command line."""


def read_program(module: str, words: Sequence[str]) -> None:
    """Read the options of `python -m MODULE` up to where its work would begin."""
    file = ROOT.joinpath(*module.split(".")).with_suffix(".py")
    source = file.read_text(encoding="utf-8")
    if "tyro.cli" not in source and "ArgumentParser" not in source:
        return  # it takes files and names as they come
    with MonkeyPatch.context() as patch, suppress(Understood):
        patch.setattr(sys, "argv", [module, *words])
        patch.setattr(tyro, "cli", _only_reading(tyro.cli))
        patch.setattr(argparse.ArgumentParser, "parse_args", _only_reading(argparse.ArgumentParser.parse_args))
        run_path(str(file), run_name="__main__")
        raise AssertionError(f"{module} did not read its command line")


def _only_reading(parse: Callable[..., Any]) -> Callable[..., Any]:
    def reading(first: Any, *args: Any, **options: Any) -> Any:
        if callable(first) and not inspect.isclass(first):  # a program, which would begin its work
            first = functools.wraps(first)(lambda *_, **__: None)
        parse(first, *args, **options)
        raise Understood

    return reading


def in_shell(line: str) -> None:
    """Run a line by bash, with this Python and the command first on its path."""
    functions = f'spikecam() {{ {INSTALLED} "$@"; }}; python() {{ {sys.executable} "$@"; }}'
    done = subprocess.run(
        ["bash", "-euc", f"{functions}; {line.replace('.venv/bin/', '')}"],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"


def alternatives(code: str) -> list[str]:
    """The command lines that `--mode a|b` stands for."""
    word = next((word for word in code.split() if "|" in word), "")
    return [code.replace(word, one) for one in word.split("|")] if word else [code]


def is_name_alone(code: str) -> bool:
    """Whether inline code names a command and gives it nothing, as `spikecam evaluate` does."""
    words = code.split()
    if words[0] == "python":
        return len(words) == 3
    return words[0] == "spikecam" and not any(word.startswith("-") for word in words)
