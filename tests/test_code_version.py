"""The digest of code: the meaning of a source counts, its layout does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from spikecam_env.code_version import UNREADABLE, code_version, meaning_of, sources_of
from spikecam_env.gap.report.reproduce import MADE_BY

PLAIN = {
    "__init__.py": "",
    "start.py": "from pack import used\nX = used.f(1)\n",
    "used.py": 'def f(x, y=2):\n    """Old."""\n    return x + y\n',
    "other.py": "Y = 1\n",
}
FORMATTED = '''# a comment
def f(
    x,
    y = 2,
):
    """New words."""

    return (x + y)  # sum


"""Of the module."""
'''


@pytest.fixture
def pack(tmp_path: Path) -> Path:
    folder = tmp_path / "pack"
    folder.mkdir()
    for name, text in PLAIN.items():
        (folder / name).write_text(text)
    return folder


def digest(folder: Path) -> str:
    code_version.cache_clear()
    return code_version("pack.start", root=folder)


def test_comments_layout_and_docstrings_change_nothing(pack: Path) -> None:
    before = digest(pack)
    (pack / "used.py").write_text(FORMATTED)
    assert digest(pack) == before


@pytest.mark.parametrize("changed", ["def f(x, y=3):\n    return x + y\n", "def f(x, y=2):\n    return x - y\n"])
def test_what_an_imported_module_does_counts(pack: Path, changed: str) -> None:
    before = digest(pack)
    (pack / "used.py").write_text(changed)
    assert digest(pack) != before


def test_what_is_not_imported_does_not_count(pack: Path) -> None:
    before = digest(pack)
    (pack / "other.py").write_text("Y = 2\n")
    assert digest(pack) == before


def test_data_beside_a_module_counts(pack: Path) -> None:
    before = digest(pack)
    (pack / "table.npz").write_bytes(b"1")
    assert digest(pack) != before


def test_imports_within_functions_and_modules_loaded_by_pkgutil_count(pack: Path) -> None:
    (pack / "start.py").write_text("def late():\n    from pack.sub import g\n    return g\n")
    (pack / "sub").mkdir()
    (pack / "sub" / "__init__.py").write_text("import pkgutil\n")
    (pack / "sub" / "one.py").write_text("import pack.other\n")
    found = {p.relative_to(pack).as_posix() for p in sources_of(("pack.start",), pack)}
    assert found == {"__init__.py", "start.py", "other.py", "sub/__init__.py", "sub/one.py"}


def test_a_package_without_sources_has_no_digest(tmp_path: Path) -> None:
    code_version.cache_clear()
    assert code_version("pack.start", root=tmp_path / "pack") == UNREADABLE


def test_fields_that_a_later_python_adds_to_its_trees_are_not_in_a_meaning(pack: Path) -> None:
    """Empty ones, as `type_params` since 3.12, are left out."""
    said = meaning_of(pack / "used.py")
    assert "type_params" not in said and "Old" not in said and "BinOp" in said


def test_what_makes_a_page_holds_the_sensor_every_effect_the_templates_and_no_command() -> None:
    from spikecam_env import code_version as this
    from spikecam_env.sensor import CATALOGUE

    found = {p.relative_to(this.ROOT).as_posix() for p in sources_of(MADE_BY)}
    assert {
        "sensor/engines/reference.py",
        "gap/screen/templates.npz",
        "sensor/presets/scsim.toml",
        "page.html.jinja",
    } <= found
    assert {f"sensor/effects/{name}.py" for name in CATALOGUE} <= found
    assert not [p for p in found if p.startswith(("cli/", "envs/", "datasets/", "bench"))]
