"""The law of an effect as a digest of its code, by which out-of-date simulations of it are known.

Comments, docstrings, annotations, imports, and the meaning of parameters and of experiments in words are left out: they
change no simulation.  Code that the effect's file imports is not followed; a change there is its author's to think of.
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
        is_text = isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        return None if is_text else self.generic_visit(node)

    def visit_Import(self, node: ast.Import) -> None:
        return None

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        return None

    def visit_arg(self, node: ast.arg) -> ast.AST:
        return ast.arg(node.arg)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        node.annotation = ast.Constant(None)
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self._with_a_body(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        return self._with_a_body(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        node.keywords = [keyword for keyword in node.keywords if keyword.arg not in _WORDS]
        return self.generic_visit(node)

    def _with_a_body(self, node: ast.FunctionDef | ast.ClassDef) -> ast.AST:
        self.generic_visit(node)
        node.body = node.body or [ast.Pass()]
        return node
