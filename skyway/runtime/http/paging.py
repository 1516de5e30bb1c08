"""Long lists in pages: an opaque cursor names the last item seen."""

import base64
import binascii
import json
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Final, Generic, TypeVar

from pydantic import ConfigDict, Field

from skyway.errors import InvalidInput
from skyway.json_model import JsonModel, QueryModel

T = TypeVar("T")
R = TypeVar("R")

#: The widest whole number that every database compares with.
_MAX_INTEGER: Final = 2**63 - 1

#: The sort key of the last item seen; the next page starts after it.
SortKey = tuple[str | int, ...]


class PageQuery(QueryModel):
    """The query of a list: ``?limit=&cursor=``."""

    limit: Annotated[
        int, Field(ge=1, le=200, description="The most items of one page, 1 to 200.")
    ] = 50
    cursor: Annotated[
        str | None,
        Field(max_length=1024, description="The `next_cursor` of the page before; none at first."),
    ] = None

    def after(self, *kinds: type[str] | type[int]) -> SortKey | None:
        """The sort key to start after, of these types; None on the first page."""
        return None if self.cursor is None else decode_cursor(self.cursor, *kinds)

    def after_id(self) -> str | None:
        """The id to start after; None on the first page."""
        key = self.after(str)
        return None if key is None else str(key[0])


class Page(JsonModel, Generic[T]):
    """One page of a list; `next_cursor` is None on the last one."""

    # Of the parametrised classes, which have no docstring of their own.
    model_config = ConfigDict(json_schema_extra={"description": "One page of a list."})

    items: Annotated[tuple[T, ...], Field(description="The items of this page.")]
    next_cursor: Annotated[
        str | None, Field(description="The `cursor` of the next page; null on the last page.")
    ] = None

    @classmethod
    def model_parametrized_name(cls, params: tuple[Any, ...]) -> str:
        """The name of a page's schema: ``DeliveryPage``. Any: as pydantic's."""
        return f"{params[0].__name__}Page"


def encode_cursor(key: SortKey) -> str:
    """The cursor that stands after the item with this sort key."""
    text = json.dumps(list(key), separators=(",", ":"))
    return base64.urlsafe_b64encode(text.encode()).decode().rstrip("=")


def decode_cursor(cursor: str, *kinds: type[str] | type[int]) -> SortKey:
    """The sort key in a cursor.

    Raises
    ------
    InvalidInput
        It is not a cursor of a list that is sorted by values of these types.
    """
    try:
        padded = cursor + "=" * (-len(cursor) % 4)
        values = json.loads(base64.b64decode(padded, altchars=b"-_", validate=True))
    except (binascii.Error, ValueError, RecursionError) as error:
        raise InvalidInput("cursor", "not a cursor of this list") from error
    fits = isinstance(values, list) and [type(value) for value in values] == list(kinds)
    if not (fits and all(map(_is_comparable, values))):
        raise InvalidInput("cursor", "not a cursor of this list")
    return tuple(values)


def page_of(
    rows: Sequence[R],
    query: PageQuery,
    *,
    item: Callable[[R], T],
    sort_key: Callable[[R], SortKey],
) -> Page[T]:
    """The page of at most `limit` + 1 rows; the last row only shows that there are more."""
    shown = rows[: query.limit]
    has_more = len(rows) > query.limit
    return Page(
        items=tuple(item(row) for row in shown),
        next_cursor=encode_cursor(sort_key(shown[-1])) if has_more else None,
    )


def _is_comparable(value: str | int) -> bool:
    """Whether a database can compare with the value: a client may invent a cursor."""
    if isinstance(value, int):
        return abs(value) <= _MAX_INTEGER
    return value.isprintable()
