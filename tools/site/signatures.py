"""Signatures as they are written: `NDArray[np.float32]`, not what that name stands for."""

from __future__ import annotations

import inspect
from typing import Any


class AsWritten(str):
    """An annotation that is shown without quotes."""

    def __repr__(self) -> str:
        return str(self)


def signature_of(value: Any, bound: bool) -> tuple[str, str] | None:
    """(arguments, what is returned) of a function, a method or a class; none where it has no signature.

    bound: leave out the first argument, as callers of a method do.
    """
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):
        return None
    given = list(signature.parameters.values())[1 if bound else 0 :]
    shown = [p.replace(annotation=_as_written(p.annotation)) for p in given]
    arguments = str(signature.replace(parameters=shown, return_annotation=inspect.Signature.empty))
    returned = signature.return_annotation
    return arguments, returned if isinstance(returned, str) and not inspect.isclass(value) else ""


def _as_written(annotation: Any) -> Any:
    return AsWritten(annotation) if isinstance(annotation, str) else annotation
