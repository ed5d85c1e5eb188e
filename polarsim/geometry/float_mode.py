"""Flushing of denormal numbers to zero while Embree casts rays, as Embree recommends.

Denormal numbers take a processor a hundred times as long as other numbers. The setting is in the MXCSR register of each
thread (Intel, Software Developer's Manual 1, 10.2.3); it is restored afterwards. Processors without that register keep
their setting.
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
    """Store the register in a slot, or load it from the slot."""
    address = ir.IntType(8).as_pointer()
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(ir.VoidType(), [address]), name)
    builder.call(function, [builder.bitcast(slot, address)])


@intrinsic
def denormals_as_zero(context):  # type: ignore[no-untyped-def] # noqa: ARG001
    """Set flush-to-zero and denormals-are-zero in this thread, and return the previous mode for `restore`."""

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
    """Restore the mode that `denormals_as_zero` returned in this thread."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def] # noqa: ARG001
        if _HAS_MXCSR:
            slot = cgutils.alloca_once(builder, _INTEGER)
            builder.store(arguments[0], slot)
            _call(builder, "llvm.x86.sse.ldmxcsr", slot)
        return context.get_dummy_value()

    return types.void(types.uint32), generate
