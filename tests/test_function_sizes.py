"""`make lint` finds functions that are too long, whatever stands around them."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools import function_sizes

LONG = "class A:\n    def f(self):\n        '''One\n        two.'''\n" + "        x = 1\n" * function_sizes.LINES


def test_a_long_method_is_found_and_its_docstring_is_not_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "long.py").write_text(LONG)
    assert list(function_sizes.sizes(LONG)) == [(2, "f", function_sizes.LINES + 1)]
    assert function_sizes.main([str(tmp_path)]) == 1
    assert "long.py:2: f has 81 lines, 80 at most" in capsys.readouterr().out
    (tmp_path / "long.py").write_text(LONG.removesuffix("        x = 1\n"))
    assert function_sizes.main([str(tmp_path)]) == 0


@pytest.mark.parametrize("source", ["", "x = 1\n", "async def f(): ...\n"])
def test_short_modules_pass(source: str, tmp_path: Path) -> None:
    (tmp_path / "short.py").write_text(source)
    assert function_sizes.main([str(tmp_path)]) == 0
