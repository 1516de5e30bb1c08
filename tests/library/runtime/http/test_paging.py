"""Long lists in pages."""

import pytest
from pydantic import ValidationError

from skyway.errors import InvalidInput
from skyway.runtime.http.paging import Page, PageQuery, decode_cursor, encode_cursor, page_of

NAMES = ("a", "b", "c", "d", "e")


def read_page(query: PageQuery) -> Page[str]:
    after = query.after(str)
    left = [name for name in NAMES if after is None or (name,) > after]
    return page_of(left[: query.limit + 1], query, item=str.upper, sort_key=lambda name: (name,))


def test_pages_together_hold_every_item_once() -> None:
    first = read_page(PageQuery(limit=2))
    second = read_page(PageQuery(limit=2, cursor=first.next_cursor))
    third = read_page(PageQuery(limit=2, cursor=second.next_cursor))

    assert (first.items, second.items, third.items) == (("A", "B"), ("C", "D"), ("E",))
    assert third.next_cursor is None


def test_a_last_page_that_is_full_has_no_next() -> None:
    assert read_page(PageQuery(limit=5)).next_cursor is None


def test_a_cursor_is_read_back() -> None:
    assert decode_cursor(encode_cursor(("san-marcos", 7)), str, int) == ("san-marcos", 7)


@pytest.mark.parametrize(
    "cursor",
    [
        "",
        "!",
        "häh",
        "AAAA",
        encode_cursor(()),
        encode_cursor((1,)),
        encode_cursor(("a", "b")),
        "e30",  # {}
        "W3RydWVd",  # [true]
        "WyJcdWQ4MDAiXQ",  # half of a surrogate pair
        "WyJcdTAwMDAiXQ",  # U+0000
    ],
)
def test_an_invalid_cursor_is_refused(cursor: str) -> None:
    with pytest.raises(InvalidInput, match="cursor: not a cursor of this list"):
        decode_cursor(cursor, str)


@pytest.mark.parametrize("number", [2**63, -(2**64)])
def test_a_number_that_no_database_holds_is_no_cursor(number: int) -> None:
    with pytest.raises(InvalidInput, match="cursor: not a cursor of this list"):
        decode_cursor(encode_cursor((number,)), int)


@pytest.mark.parametrize("limit", [0, 201])
def test_a_page_has_1_to_200_items(limit: int) -> None:
    with pytest.raises(ValidationError):
        PageQuery(limit=limit)
