"""Arrays without reference counts, for loops that pass them on millions of times a second.

Numba counts references to every array that a compiled function receives, or takes out of a tuple, atomically: with the
fifty arrays of a live triangulation that is half a microsecond a call, more than the work itself.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.extending import intrinsic


@intrinsic
def borrowed(typingctx: Any, value: Any) -> Any:
    """Return an array, or a tuple with its arrays, that holds no reference; whoever called must keep the original."""

    def without(context: Any, builder: Any, kind: Any, item: Any) -> Any:
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, item)
            for name in ("meminfo", "parent"):
                setattr(array, name, cgutils.get_null_value(getattr(array, name).type))
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):  # type: ignore[attr-defined]
            for k, member in enumerate(kind):
                item = builder.insert_value(item, without(context, builder, member, builder.extract_value(item, k)), k)
        return item

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return without(context, builder, signature.args[0], arguments[0])

    return value(value), codegen
