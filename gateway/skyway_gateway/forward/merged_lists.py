"""Merges the pages of all servers of composition into one page in the same order.

A cursor is the sort key of the last item on a page. It means the same at every server, so every
server gets the caller's cursor, and the merged page has a cursor of the same form.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from skyway.runtime.http.paging import encode_cursor

#: A JSON object from our own services, which is valid and is not checked again.
_Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class ListOrder:
    """The member by which a list is sorted."""

    member: str
    is_newest_first: bool = False


#: The lists that may span networks, by their paths.
MERGED: Final[Mapping[str, ListOrder]] = {
    "/v1/networks": ListOrder("network_id"),
    "/v1/missions": ListOrder("mission_id", is_newest_first=True),
    "/v1/closures": ListOrder("closure_id"),
    "/v1/zones": ListOrder("closure_id"),
    "/v1/ground-stops": ListOrder("closure_id"),
    "/v1/alarms": ListOrder("alarm_id", is_newest_first=True),
    "/v1/quarantine": ListOrder("quarantine_id", is_newest_first=True),
    "/v1/providers/{provider_id}/schedule": ListOrder("drone_id"),
    "/v1/stats/pads": ListOrder("station_id"),
    "/v1/stats/drones": ListOrder("drone_id"),
}

#: The counts that may span networks: objects of numbers.
COUNTED: Final = frozenset({"/v1/stats/missions"})

#: The member that weights a share: the number of pads or drones that the share belongs to.
_SHARED_BY: Final = ("pads", "drones")


def merged_page(pages: Sequence[_Json], order: ListOrder, *, limit: int) -> _Json:
    """The first items of all pages, at most `limit`; other members come from the first page."""
    items = sorted(
        (item for page in pages for item in page["items"]),
        key=lambda item: str(item[order.member]),
        reverse=order.is_newest_first,
    )
    has_more = len(items) > limit or any(page.get("next_cursor") for page in pages)
    shown = items[:limit]
    cursor = encode_cursor((shown[-1][order.member],)) if has_more and shown else None
    merged = {**pages[0], "items": shown, "next_cursor": cursor}
    if "total" in merged:
        merged["total"] = _total(page["total"] for page in pages)
    return merged


def merged_counts(answers: Sequence[_Json]) -> _Json:
    """The sums of all objects of numbers; other members come from the first answer."""
    merged = dict(answers[0])
    for name, value in answers[0].items():
        if isinstance(value, dict):
            sums: Counter[str] = Counter()
            for answer in answers:
                sums.update(answer[name])
            merged[name] = dict(sums)
    return merged


def _total(totals: Iterable[_Json]) -> _Json:
    """The sums of numbers. A share is weighted by the number of its pads or drones."""
    parts = list(totals)
    merged = {name: sum(each[name] or 0 for each in parts) for name in parts[0]}
    if "utilisation" in merged:
        [shared_by] = [name for name in _SHARED_BY if name in merged]
        whole = merged[shared_by]
        used = sum((each["utilisation"] or 0) * each[shared_by] for each in parts)
        merged["utilisation"] = used / whole if whole else None
    return merged
