"""Let a compiled function use the processor's widest registers.

LLVM splits its loops to 256 bits on processors that have 512 (`prefer-vector-width`), out of care for clocks that old
ones lowered; where a loop is nothing but vector arithmetic the full width is a fifth faster.  The attribute sits on one
function; it does nothing elsewhere, nor on processors without such registers, and changes no bit.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic


@intrinsic  # type: ignore[untyped-decorator]
def use_widest_vectors(typing_context: Any) -> Any:
    """To be called, without arguments, in the function that is to be compiled so."""

    def mark(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # llvmlite's own `add` knows only attributes without a value.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), mark
