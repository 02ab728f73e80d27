"""Instructions to the compiler that numba has no word for.  None can change a bit of a result."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, cast

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

Given = ParamSpec("Given")


def instruction(function: Callable[Concatenate[Any, Given], Any]) -> Callable[Given, Any]:
    """numba's `intrinsic`, with the types of a call: its first argument, the typing context, is the compiler's."""
    return cast(Callable[Given, Any], intrinsic(function))


@instruction
def use_widest_vectors(typing_context: Any) -> Any:
    """Compile the function that calls this with the processor's widest registers."""

    # LLVM splits loops to 256 bits where a processor has 512 (`prefer-vector-width`), out of care for old ones that
    # then lowered their clock; where a loop is nothing but vector arithmetic, the full width is a fifth faster.
    def mark(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # llvmlite's own `add` knows only attributes without a value.
        set.add(builder.function.attributes, '"prefer-vector-width"="512"')
        return context.get_dummy_value()

    return types.void(), mark


@instruction
def take_ticket(typing_context: Any, tickets: Any, row: Any) -> Any:
    """The next number of a counter that threads share: adds one to tickets[row, 0] (int64), returns its old value."""

    def fetch_and_add(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = make_array(signature.args[0])(context, builder, arguments[0])
        zero = cgutils.intp_t(0)
        counter = cgutils.get_item_pointer(context, builder, signature.args[0], array, (arguments[1], zero))
        return builder.atomic_rmw("add", counter, cgutils.intp_t(1), "monotonic")

    return types.int64(tickets, types.int64), fetch_and_add


@instruction
def pointer_to(typing_context: Any, address: Any, kind: Any) -> Any:
    """The pointer to numbers of this kind (np.float32, ...) at an address, for `numba.carray`.

    Args:
        address: from a table, by which one call takes arrays of many cameras; its maker keeps the arrays alive.
        kind: of the numbers.
    """
    pointer = types.CPointer(kind.dtype)

    def cast(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(pointer))

    return pointer(address, kind), cast


@instruction
def prefetch(typing_context: Any, address: Any) -> Any:
    """Ask for the line of cache at an address, which will soon be read; any address will do."""

    def ask(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        byte = ir.IntType(8).as_pointer()
        flag = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, flag, flag, flag])
        function = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        pointer = builder.inttoptr(arguments[0], byte)
        builder.call(function, [pointer, flag(0), flag(3), flag(1)])  # to read, into the nearest cache, of data
        return context.get_dummy_value()

    return types.void(types.int64), ask


@instruction
def two_at(typing_context: Any, address: Any) -> Any:
    """The two uint32 at an address, the first in the lower half of a uint64 (little-endian processors): one read."""

    def read(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        return builder.load(builder.inttoptr(arguments[0], word.as_pointer()), align=4)

    return types.uint64(types.int64), read


@instruction
def borrowed(typing_context: Any, values: Any) -> Any:
    """The same array, or tuple of arrays, without an owner.

    Compiled code counts the uses of an array that has one, by two locked instructions whenever it comes out of a tuple.
    Whoever calls this keeps the owner until after the last use.
    """

    def without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, types.BaseTuple):
            parts = zip(kind.types, cgutils.unpack_tuple(builder, value), strict=True)  # type: ignore[attr-defined]
            return context.make_tuple(builder, kind, [without_owner(context, builder, *part) for part in parts])
        if isinstance(kind, types.Array):
            array = make_array(kind)(context, builder, value)
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            array.parent = cgutils.get_null_value(array.parent.type)
            return array._getvalue()
        return value

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return without_owner(context, builder, signature.args[0], arguments[0])

    return values(values), build


def address_of(array: NDArray[Any]) -> int:
    """Where an array begins in memory."""
    return int(array.__array_interface__["data"][0])
