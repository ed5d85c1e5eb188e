"""Numbers too small for a float's full precision counted as zero while Embree casts rays, as Embree asks for.

Such numbers take a processor a hundred times as long as others. The setting is a thread's own, in its MXCSR register
(Intel, Software Developer's Manual 1, 10.2.3); threads of a caller get theirs back. Processors without that register
keep their setting.
"""

from __future__ import annotations

import platform
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

_FLUSH_TO_ZERO, _DENORMALS_ARE_ZERO = 1 << 15, 1 << 6
_HAS_MXCSR = platform.machine().lower() in ("x86_64", "amd64", "i686", "x86")
_INTEGER = ir.IntType(32)


def _call(builder: ir.IRBuilder, name: str, slot: Any) -> None:
    """Store the register in a slot, or load it from there."""
    address = ir.IntType(8).as_pointer()
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.VoidType(), [address]), name)
    builder.call(function, [builder.bitcast(slot, address)])


@intrinsic
def denormals_as_zero(context):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Set flush-to-zero and denormals-are-zero in this thread; what `restore` takes to undo that."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def] # noqa: ARG001
        if not _HAS_MXCSR:
            return _INTEGER(0)
        slot = cgutils.alloca_once(builder, _INTEGER)
        _call(builder, "llvm.x86.sse.stmxcsr", slot)
        before = builder.load(slot)
        builder.store(builder.or_(before, _INTEGER(_FLUSH_TO_ZERO | _DENORMALS_ARE_ZERO)), slot)
        _call(builder, "llvm.x86.sse.ldmxcsr", slot)
        return before

    return types.uint32(), generate


@intrinsic
def restore(context, mode):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Give this thread the setting back that `denormals_as_zero` found."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def] # noqa: ARG001
        if _HAS_MXCSR:
            slot = cgutils.alloca_once(builder, _INTEGER)
            builder.store(arguments[0], slot)
            _call(builder, "llvm.x86.sse.ldmxcsr", slot)
        return context.get_dummy_value()

    return types.void(types.uint32), generate
