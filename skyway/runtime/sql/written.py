"""Statements that are run again and again: SQLAlchemy writes each of them once, for PostgreSQL.

Each time it runs a statement SQLAlchemy looks for its text, names its parameters and dresses a
cursor: that takes the processor twice as long as the driver takes for the rest.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple
from weakref import WeakKeyDictionary

from sqlalchemy import BindParameter, ColumnElement, Dialect, Executable
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.dml import UpdateBase
from sqlalchemy.sql.selectable import SelectBase

#: What a statement is told, by name; Any, since it may be of whatever type a column takes.
Values = Mapping[str, Any]

#: Statements that are made for one block are run once or twice; only others are worth writing.
_RUNS_BEFORE: Final = 2


class _Argument(NamedTuple):
    """What the driver is told at one place: a parameter, or a constant of the statement.

    Any: it may be of whatever type a column takes.
    """

    name: str | None
    convert: Callable[[Any], Any] | None
    constant: Any


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Written:
    """A statement as PostgreSQL's driver takes it."""

    text: str
    arguments: tuple[_Argument, ...]
    #: What each row holds.
    columns: tuple[ColumnElement[Any], ...]

    def values(self, parameters: Values) -> list[Any]:
        """The arguments in the driver's order.

        Raises
        ------
        KeyError
            A parameter is missing.
        """
        return [
            constant
            if name is None
            else parameters[name]
            if convert is None
            else convert(parameters[name])
            for name, convert, constant in self.arguments
        ]


def write(
    statement: SelectBase | UpdateBase,
    names: Collection[str],
    *,
    many: bool,
    dialect: Dialect,
) -> Written | None:
    """A statement with parameters of these names, to be run for one set of them or for many.

    None when it takes more than a text and its arguments; then SQLAlchemy has to run it.
    """
    try:
        compiled = statement.compile(
            dialect=dialect, column_keys=sorted(names), for_executemany=many
        )
        if not isinstance(compiled, SQLCompiler) or not _is_plain(compiled, names):
            return None
        expanded = compiled.construct_expanded_state(dict.fromkeys(names))
    except SQLAlchemyError:
        return None  # SQLAlchemy shall refuse it in its own words
    columns = tuple(statement.exported_columns)
    if len(columns) != len(compiled._result_columns):
        return None  # it finds what is no column to SQLAlchemy, such as a text
    if many and columns:
        return None  # the driver answers no rows of many runs
    arguments: list[_Argument] = []
    for place in expanded.positiontup or ():
        bind = compiled.binds.get(place)
        if bind is None:  # one of the constants that a column is IN
            convert = expanded.processors.get(place)
        else:
            convert = bind.type.dialect_impl(dialect).bind_processor(dialect)
        name = _name_of(bind, place, names)
        constant = None
        if name is None:
            constant = expanded.parameters[place]
            constant = constant if convert is None else convert(constant)
        arguments.append(_Argument(name, convert, constant))
    return Written(expanded.statement, tuple(arguments), columns)


def _is_plain(compiled: SQLCompiler, names: Collection[str]) -> bool:
    """Whether a statement is its text and its arguments, with nothing to be done before or after.

    Values made in Python, keys to be asked for and lists of any length take more than that.
    """
    takes_list = any(bind.key in names for bind in compiled.post_compile_params)
    is_computed = any(bind.callable is not None for bind in compiled.binds.values())
    return not (
        takes_list
        or is_computed
        or compiled.literal_execute_params
        or compiled.escaped_bind_names
        or compiled.prefetch
        or compiled.implicit_returning
    )


def _name_of(bind: BindParameter[Any] | None, place: str, names: Collection[str]) -> str | None:
    """Which parameter is put at a place; None for a constant."""
    if bind is not None and bind.key in names:
        return bind.key
    return place if bind is not None and place in names else None


@dataclass(slots=True)
class _Known:
    """How often a statement was run, and how it is written for which parameters."""

    runs: int = 0
    written: dict[tuple[frozenset[str], bool], Written | None] = field(default_factory=dict)


class WrittenStatements:
    """The statements of one database that were run before, for as long as somebody holds them."""

    def __init__(self) -> None:
        self._known: WeakKeyDictionary[Executable, _Known] = WeakKeyDictionary()

    def get(
        self, statement: Executable, names: Collection[str], *, many: bool, dialect: Dialect
    ) -> Written | None:
        """How a statement is written for these parameters; None when SQLAlchemy is to run it."""
        if not isinstance(statement, SelectBase | UpdateBase):
            return None
        known = self._known.get(statement)
        if known is None:
            known = self._known[statement] = _Known()
        if known.runs < _RUNS_BEFORE:
            known.runs += 1
            return None
        key = (frozenset(names), many)
        if key not in known.written:
            known.written[key] = write(statement, names, many=many, dialect=dialect)
        return known.written[key]
