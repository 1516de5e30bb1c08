"""Handles: the kernels' records behind one pointer each.

Compiled code splits a named tuple into all its arrays at every call, and takes minutes to compile.
A handle is passed as one pointer. Handles share their arrays with the record they were made from,
so Python reads the results of a search from that record.
"""

from collections.abc import Callable
from typing import Any, Final, TypeVar

import numba
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.runtime.context import NRTContext
from numba.experimental import structref
from numba.extending import lower_getattr_generic

from skyway.planner.kernels.compiler import entrance
from skyway.planner.kernels.memory import Memory
from skyway.planner.kernels.records import (
    Book,
    Closed,
    Found,
    Skyway,
    Task,
    Terms,
    TripRows,
)

_Record = TypeVar("_Record", Skyway, Closed, Book, Task, Memory, Terms, TripRows, Found)


class _HandleType(types.StructRef):  # type: ignore[misc]  # numba has no types
    def preprocess_fields(self, fields: Any) -> Any:  # numba's own pairs of name and type
        """The fields with types that do not depend on their values."""
        return tuple((name, types.unliteral(of_type)) for name, of_type in fields)


def _registered(handle_type: type[_HandleType]) -> type[_HandleType]:
    """Register a type of handles whose fields can also be read where no references are counted."""
    structref.register(handle_type)

    # The same as numba's own, which refuses to work where no references are counted.
    @lower_getattr_generic(handle_type)  # type: ignore[untyped-decorator]
    def read(context: Any, builder: Any, of_type: Any, handle: Any, field: str) -> Any:
        pointer = cgutils.create_struct_proxy(of_type)(context, builder, value=handle).meminfo
        address = NRTContext(context, enabled=True).meminfo_data(builder, pointer)
        record_type = of_type.get_data_type()
        as_record = context.data_model_manager[record_type].get_value_type().as_pointer()
        record = cgutils.create_struct_proxy(record_type)(
            context, builder, ref=builder.bitcast(address, as_record)
        )
        of_field = of_type.field_dict[field]
        return impl_ret_borrowed(context, builder, of_field, getattr(record, field))

    return handle_type


@_registered
class SkywayType(_HandleType):
    """The compiled type of a skyway's handle."""


@_registered
class ClosedType(_HandleType):
    """The compiled type of the closures' handle."""


@_registered
class BookType(_HandleType):
    """The compiled type of a pad book's handle."""


@_registered
class TaskType(_HandleType):
    """The compiled type of a task's handle."""


@_registered
class MemoryType(_HandleType):
    """The compiled type of a memory's handle."""


@_registered
class TermsType(_HandleType):
    """The compiled type of the terms' handle."""


@_registered
class TripRowsType(_HandleType):
    """The compiled type of the handle of trips."""


@_registered
class FoundType(_HandleType):
    """The compiled type of the handle of what is found for trips."""


class SkywayHandle(structref.StructRefProxy):  # type: ignore[misc]  # numba has no types
    """A skyway behind a pointer."""


class ClosedHandle(structref.StructRefProxy):  # type: ignore[misc]
    """Closures behind a pointer."""


class BookHandle(structref.StructRefProxy):  # type: ignore[misc]
    """A pad book behind a pointer."""


class TaskHandle(structref.StructRefProxy):  # type: ignore[misc]
    """A task behind a pointer."""


class MemoryHandle(structref.StructRefProxy):  # type: ignore[misc]
    """A memory behind a pointer."""


class TermsHandle(structref.StructRefProxy):  # type: ignore[misc]
    """Terms behind a pointer."""


class TripRowsHandle(structref.StructRefProxy):  # type: ignore[misc]
    """Trips behind a pointer."""


class FoundHandle(structref.StructRefProxy):  # type: ignore[misc]
    """What is found for trips, behind a pointer."""


structref.define_proxy(SkywayHandle, SkywayType, list(Skyway._fields))
structref.define_proxy(ClosedHandle, ClosedType, list(Closed._fields))
structref.define_proxy(BookHandle, BookType, list(Book._fields))
structref.define_proxy(TaskHandle, TaskType, list(Task._fields))
structref.define_proxy(MemoryHandle, MemoryType, list(Memory._fields))
structref.define_proxy(TermsHandle, TermsType, list(Terms._fields))
structref.define_proxy(TripRowsHandle, TripRowsType, list(TripRows._fields))
structref.define_proxy(FoundHandle, FoundType, list(Found._fields))


@entrance
def _skyway_handle(record: Skyway) -> Any:
    return SkywayHandle(*record)


@entrance
def _closed_handle(record: Closed) -> Any:
    return ClosedHandle(*record)


@entrance
def _book_handle(record: Book) -> Any:
    return BookHandle(*record)


@entrance
def task_handle(record: Task) -> Any:
    """A task behind its handle, for kernels that make tasks."""
    return TaskHandle(*record)


@entrance
def _memory_handle(record: Memory) -> Any:
    return MemoryHandle(*record)


@entrance
def _terms_handle(record: Terms) -> Any:
    return TermsHandle(*record)


@entrance
def _trip_rows_handle(record: TripRows) -> Any:
    return TripRowsHandle(*record)


@entrance
def _found_handle(record: Found) -> Any:
    return FoundHandle(*record)


_MAKERS: Final[dict[Any, Callable[[Any], Any]]] = {
    Skyway: _skyway_handle,
    Closed: _closed_handle,
    Book: _book_handle,
    Task: task_handle,
    Memory: _memory_handle,
    Terms: _terms_handle,
    TripRows: _trip_rows_handle,
    Found: _found_handle,
}


def handle_of(record: _Record) -> _Record:
    """The record's handle, with the same fields for the kernels; uncompiled, the record itself."""
    if numba.config.DISABLE_JIT:
        return record
    handle: _Record = _MAKERS[type(record)](record)
    return handle
