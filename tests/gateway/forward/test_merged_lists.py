"""The pages of several servers are merged into the pages of one list."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from skyway_gateway.forward.cell_routes import ListOrder, merged_counts, merged_page

from skyway.runtime.http.paging import decode_cursor, encode_cursor

_IDS = st.sets(st.text("abc", min_size=1, max_size=4), max_size=8)


def page_of(ids: set[str], order: ListOrder, *, cursor: str | None, limit: int) -> dict[str, Any]:
    """A page as a server makes it."""
    after = None if cursor is None else str((decode_cursor(cursor, str) or ("",))[0])
    every = sorted(ids, reverse=order.is_newest_first)
    if after is not None:
        every = [e for e in every if (e < after if order.is_newest_first else e > after)]
    shown = every[:limit]
    more = encode_cursor((shown[-1],)) if len(every) > limit else None
    return {"items": [{"alarm_id": each} for each in shown], "next_cursor": more}


@given(
    servers=st.lists(_IDS, min_size=1, max_size=3), limit=st.integers(1, 5), newest=st.booleans()
)
def test_the_pages_together_are_the_sorted_list_of_all_items(
    servers: list[set[str]], limit: int, newest: bool
) -> None:
    # An id belongs to one server.
    own = [ids - set().union(*servers[:n]) for n, ids in enumerate(servers)]
    order = ListOrder("alarm_id", is_newest_first=newest)
    seen: list[str] = []
    cursor: str | None = None
    for _ in range(40):
        pages = [page_of(ids, order, cursor=cursor, limit=limit) for ids in own]
        merged = merged_page(pages, order, limit=limit)
        assert len(merged["items"]) <= limit
        seen += [each["alarm_id"] for each in merged["items"]]
        if (cursor := merged["next_cursor"]) is None:
            break

    assert seen == sorted(set().union(*own), reverse=newest)


def test_totals_are_sums_and_shares_are_weighted() -> None:
    pages = [
        {"items": [], "total": {"pads": 1, "charging_s": 5.0, "utilisation": 1.0}},
        {"items": [], "total": {"pads": 3, "charging_s": 0.0, "utilisation": None}},
    ]

    merged = merged_page(pages, ListOrder("station_id"), limit=10)

    assert merged["total"] == {"pads": 4, "charging_s": 5.0, "utilisation": 0.25}


def test_counts_are_added_by_their_names() -> None:
    one = {"at": "now", "by_state": {"ACTIVE": 2}, "unsent": {}}
    other = {"at": "later", "by_state": {"ACTIVE": 1, "QUEUED": 4}, "unsent": {"mqtt": 1}}

    merged = merged_counts([one, other])

    assert merged == {"at": "now", "by_state": {"ACTIVE": 3, "QUEUED": 4}, "unsent": {"mqtt": 1}}
