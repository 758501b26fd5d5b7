"""Records of arrays as one pointer, for compiled functions that pass them on millions of times a second.

Numba hands a record to a function array by array, each of them seven numbers: with the fifty arrays of a live
triangulation that is half of all instructions to be compiled. It counts references to each array too, atomically, which
takes longer than the work itself. A borrowed record is the address of one that whoever called keeps.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, register_model


class Borrowed(types.Type):
    """The address of a record (a NamedTuple of arrays and numbers), which stays as it is while it is used."""

    def __init__(self, record: Any) -> None:
        self.record = record
        super().__init__(name=f"Borrowed({record})")

    @property
    def instance_class(self) -> type:
        """The class of the record."""
        kind: type = self.record.instance_class
        return kind


@register_model(Borrowed)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, manager.lookup(kind.record).get_value_type().as_pointer())


@infer_getattr
class _Members(AttributeTemplate):
    key = Borrowed

    def generic_resolve(self, kind: Any, name: str) -> Any:
        """Return the type of a member."""
        fields = kind.record.fields
        if name not in fields:
            return None
        member = kind.record.types[fields.index(name)]
        return Borrowed(member) if isinstance(member, types.BaseNamedTuple) else member  # type: ignore[attr-defined]


@lower_getattr_generic(Borrowed)
def _member(context: Any, builder: Any, kind: Any, address: Any, name: str) -> Any:
    """Load a member; an array without what counts its references, of a record within the record the address."""
    k = kind.record.fields.index(name)
    member, place = kind.record.types[k], cgutils.gep_inbounds(builder, address, 0, k)
    if isinstance(member, types.BaseNamedTuple):  # type: ignore[attr-defined]
        return place
    return _without_references(context, builder, member, builder.load(place))


def _without_references(context: Any, builder: Any, kind: Any, item: Any) -> Any:
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, item)
        for name in ("meminfo", "parent"):
            setattr(array, name, cgutils.get_null_value(getattr(array, name).type))
        return array._getvalue()
    return item


@intrinsic
def borrowed(typingctx: Any, value: Any) -> Any:
    """Return a record as a pointer, or an array that holds no reference; whoever called must keep the original.

    Anything else is returned as it is.
    """
    if isinstance(value, types.Array):
        return value(value), lambda context, builder, signature, arguments: _without_references(
            context, builder, value, arguments[0]
        )
    if isinstance(value, types.BaseNamedTuple):  # type: ignore[attr-defined]
        return Borrowed(value)(value), lambda context, builder, signature, arguments: cgutils.alloca_once_value(
            builder, arguments[0]
        )
    return value(value), lambda context, builder, signature, arguments: arguments[0]
