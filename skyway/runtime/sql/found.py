"""What a statement found, told as SQLAlchemy's results tell it, at a tenth of their cost."""

from collections.abc import Iterator, Sequence
from typing import Any, Generic, TypeVar

from sqlalchemy import Row, RowMapping
from sqlalchemy.exc import MultipleResultsFound, NoResultFound

ItemT = TypeVar("ItemT")

#: A row of any query: Any, since its columns are of every type.
AnyRow = Row[*tuple[Any, ...]]


class Found(Generic[ItemT]):
    """Everything that was found, in order."""

    def __init__(self, items: Sequence[ItemT]) -> None:
        self._items = items

    def __iter__(self) -> Iterator[ItemT]:
        return iter(self._items)

    def all(self) -> Sequence[ItemT]:
        """All of it."""
        return self._items

    def first(self) -> ItemT | None:
        """The first; None when nothing was found."""
        return self._items[0] if self._items else None

    def one_or_none(self) -> ItemT | None:
        """The only one; None when nothing was found."""
        if len(self._items) > 1:
            raise MultipleResultsFound("more than one row was found")
        return self.first()

    def one(self) -> ItemT:
        """The only one."""
        if not self._items:
            raise NoResultFound("no row was found")
        if len(self._items) > 1:
            raise MultipleResultsFound("more than one row was found")
        return self._items[0]


class FoundRows(Found[AnyRow]):
    """The rows that a statement found or returned. Any: columns are of every type.

    Parameters
    ----------
    status
        What PostgreSQL says that it has done, such as ``UPDATE 3``; None for many runs.
    returns_rows
        Whether the statement is one that finds or returns rows.
    """

    def __init__(self, rows: Sequence[AnyRow], *, status: str | None, returns_rows: bool) -> None:
        super().__init__(rows)
        self._status = status
        self.returns_rows = returns_rows

    @property
    def rowcount(self) -> int:
        """How many rows were found or written; -1 when nobody knows."""
        number = (self._status or "").rpartition(" ")[2]
        return int(number) if number.isdecimal() else -1

    def scalars(self) -> Found[Any]:
        """The first column."""
        return Found([row[0] for row in self._items])

    def mappings(self) -> Found[RowMapping]:
        """Rows by the names of their columns."""
        return Found([row._mapping for row in self._items])

    def scalar(self) -> Any:
        """The first column of the first row; None when nothing was found."""
        return self._items[0][0] if self._items else None

    def scalar_one(self) -> Any:
        """The first column of the only row."""
        return self.one()[0]

    def scalar_one_or_none(self) -> Any:
        """The first column of the only row; None when nothing was found."""
        row = self.one_or_none()
        return None if row is None else row[0]
