"""The linter of words: long sentences and clauses in place of a noun are listed, in every kind of text."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools import words

LONG = " ".join(["word"] * (words.WORDS + 1))
CLEAN = '"""Read a file.  The rest follows."""\n# One idea a sentence.\nTEXT = "short and plain words"\n'


@pytest.mark.parametrize("text", ['"""{}."""\n', "# {}.\n", 'TEXT = "{}."\n', 'n = 1\nTEXT = f"{{n}} {}."\n'])
@pytest.mark.parametrize("sentence, fault", [(LONG, "long"), ("It returns what it was given", "what")])
def test_a_fault_is_listed_with_its_file_and_line(text: str, sentence: str, fault: str, tmp_path: Path, capsys) -> None:
    path = tmp_path / "module.py"
    path.write_text(text.format(sentence))
    assert words.main([str(path)]) == 1
    assert f"{path}:{1 + text.startswith('n')}: {fault}: " in capsys.readouterr().out


def test_plain_text_passes_and_a_question_may_ask_what(tmp_path: Path, capsys) -> None:
    (tmp_path / "module.py").write_text(CLEAN + '# So what is it?\n"""\n>>> what = 1 + 1 + 1\n"""\n')
    assert words.main([str(tmp_path)]) == 0
    assert capsys.readouterr().out.startswith("what 0.00 %")
