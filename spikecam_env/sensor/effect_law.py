"""The law of an effect as a digest of its code: where it differs, earlier simulations of the effect are out of date.

Comments, docstrings and other words are left out: they change no simulation.  Imported code is not followed.
"""

from __future__ import annotations

import ast
import hashlib

from spikecam_env.sensor.effects import Effect
from spikecam_env.sensor.own_effects import source_of

_WORDS = ("doc", "experiment", "family")
"""Keywords of `parameter` and `Identification` that are words alone."""


def law_digest(effect: type[Effect]) -> str:
    """64 hexadecimal digits; the same for the same code, however it is commented and laid out."""
    tree = _WithoutWords().visit(ast.parse(source_of(effect)))
    return hashlib.sha256(ast.unparse(tree).encode()).hexdigest()


class _WithoutWords(ast.NodeTransformer):
    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return ast.Pass() if _is_text(node) else self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        """Meanings of fields go; the class docstring, first, stays as a `pass`."""
        node.body = [part for n, part in enumerate(node.body) if n == 0 or not _is_text(part)]
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        node.keywords = [keyword for keyword in node.keywords if keyword.arg not in _WORDS]
        return self.generic_visit(node)


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
