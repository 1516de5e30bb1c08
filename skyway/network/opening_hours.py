"""Opening hours of a station: weekly, with exceptions, in a named time zone.

A station without opening hours is always open. Hours are wall times of their zone. A wall time that
the clock skips in spring counts as if the clock had not been set; one that it repeats in autumn
means the first of the two.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from functools import lru_cache
from typing import Any, Final
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from skyway.errors import InvalidNetwork
from skyway.network import fields

#: The property of a station that holds its opening hours.
HOURS: Final = "opening_hours"

#: The days of `weekly`, Monday first as in `date.weekday`.
DAYS: Final = ("mon", "tue", "wed", "thu", "fri", "sat", "sun")

#: The most spans of one day, and the most exceptions of one station. Our own choice.
MAX_SPANS: Final = 12
MAX_EXCEPTIONS: Final = 1_000

_MEMBERS: Final = ("time_zone", "weekly", "exceptions")
_SPAN: Final = re.compile(r"(\d\d):(\d\d)-(\d\d):(\d\d)", re.ASCII)
_DAY_MINUTES: Final = 24 * 60

#: From one minute of a day until before another, minutes after midnight.
Span = tuple[int, int]
#: From one moment until before another.
OpenTime = tuple[datetime, datetime]


@dataclass(frozen=True, slots=True)
class OpeningHours:
    """When a station is open: `weekly` by weekday, and other hours at the dates in `exceptions`."""

    time_zone: str
    weekly: tuple[tuple[Span, ...], ...]
    exceptions: tuple[tuple[date, tuple[Span, ...]], ...] = ()

    def open_times(self, start_at: datetime, end_at: datetime) -> list[OpenTime]:
        """The times in [start_at, end_at] at which the station is open, in order and apart."""
        merged: list[OpenTime] = []
        for opens_at, closes_at in sorted(self._between(start_at, end_at)):
            if merged and opens_at <= merged[-1][1]:
                merged[-1] = (merged[-1][0], max(merged[-1][1], closes_at))
            else:
                merged.append((opens_at, closes_at))
        return [
            (max(opens_at, start_at), min(closes_at, end_at))
            for opens_at, closes_at in merged
            if opens_at <= end_at and closes_at >= start_at
        ]

    def is_open(self, at: datetime) -> bool:
        """Whether the station is open at this moment."""
        day = timedelta(days=1)
        return any(opens <= at < closes for opens, closes in self.open_times(at - day, at + day))

    def _between(self, start_at: datetime, end_at: datetime) -> Iterator[OpenTime]:
        zone = ZoneInfo(self.time_zone)
        # A day more at both ends: an open time may begin on the day before.
        day = start_at.astimezone(zone).date() - timedelta(days=1)
        last = end_at.astimezone(zone).date() + timedelta(days=1)
        while day <= last:
            yield from _open_on(self, day)
            day += timedelta(days=1)

    def spans_on(self, day: date) -> tuple[Span, ...]:
        """The spans of this date, minutes after midnight."""
        return dict(self.exceptions).get(day, self.weekly[day.weekday()])


@lru_cache(maxsize=100_000)
def _open_on(hours: OpeningHours, day: date) -> tuple[OpenTime, ...]:
    zone = ZoneInfo(hours.time_zone)
    times = (
        (_moment(day, from_min, zone), _moment(day, until_min, zone))
        for from_min, until_min in hours.spans_on(day)
    )
    return tuple((opens_at, closes_at) for opens_at, closes_at in times if opens_at < closes_at)


def _moment(day: date, minutes: int, zone: ZoneInfo) -> datetime:
    if minutes == _DAY_MINUTES:
        day, minutes = day + timedelta(days=1), 0
    wall = datetime.combine(day, time(minutes // 60, minutes % 60), zone)
    return wall.astimezone(UTC)


def read_opening_hours(value: Any, path: str) -> OpeningHours:  # any JSON value, checked here
    """The opening hours in a station's property.

    Raises
    ------
    InvalidNetwork
        Names the field at fault: an unknown zone, day or date, spans that are reversed, overlap,
        or are too many, or no span at all.
    """
    members = fields.mapping(value, path)
    for name in members:
        if name not in _MEMBERS:
            raise InvalidNetwork(f"{path}.{name}", f"is none of {', '.join(_MEMBERS)}")
    weekly = fields.mapping(members.get("weekly", {}), f"{path}.weekly")
    for name in weekly:
        if name not in DAYS:
            raise InvalidNetwork(f"{path}.weekly.{name}", f"is none of {', '.join(DAYS)}")
    if "weekly" not in members:
        raise InvalidNetwork(f"{path}.weekly", "is missing")
    hours = OpeningHours(
        time_zone=_zone(members.get("time_zone", "UTC"), f"{path}.time_zone"),
        weekly=tuple(_spans(weekly.get(day, []), f"{path}.weekly.{day}") for day in DAYS),
        exceptions=_exceptions(members.get("exceptions", {}), f"{path}.exceptions"),
    )
    if not any(hours.weekly) and not any(spans for _, spans in hours.exceptions):
        raise InvalidNetwork(f"{path}.weekly", "has no span, so the station would never open")
    return hours


def _zone(value: Any, path: str) -> str:
    name = fields.text_or_none(value, path)
    try:
        if name:
            ZoneInfo(name)
            return name
    except (ZoneInfoNotFoundError, ValueError, OSError):
        pass
    raise InvalidNetwork(path, f"{fields.shown(value)} is not the name of a time zone")


def _exceptions(value: Any, path: str) -> tuple[tuple[date, tuple[Span, ...]], ...]:
    days: Mapping[str, Any] = fields.mapping(value, path)
    if len(days) > MAX_EXCEPTIONS:
        raise InvalidNetwork(path, f"{len(days)} dates exceed the limit of {MAX_EXCEPTIONS}")
    return tuple(
        sorted((_date(name, path), _spans(spans, f"{path}.{name}")) for name, spans in days.items())
    )


def _date(name: str, path: str) -> date:
    try:
        day = date.fromisoformat(name)
    except ValueError:
        day = None
    if day is None or day.isoformat() != name or not date.min < day < date.max:
        raise InvalidNetwork(path, f"{fields.shown(name)} is not a date such as 2026-12-24")
    return day


def _spans(value: Any, path: str) -> tuple[Span, ...]:
    listed = fields.array(value, path)
    if len(listed) > MAX_SPANS:
        raise InvalidNetwork(path, f"{len(listed)} spans exceed the limit of {MAX_SPANS}")
    spans: list[Span] = []
    for number, each in enumerate(listed):
        span = _span(each, f"{path}.{number}")
        if spans and span[0] < spans[-1][1]:
            detail = f"{each!r} begins before {listed[number - 1]!r} ends"
            raise InvalidNetwork(f"{path}.{number}", detail)
        spans.append(span)
    return tuple(spans)


def _span(value: Any, path: str) -> Span:
    found = _SPAN.fullmatch(value) if isinstance(value, str) else None
    if found is None:
        detail = f"{fields.shown(value)} is not a span such as '08:00-17:30'"
        raise InvalidNetwork(path, detail)
    from_h, from_min, until_h, until_min = map(int, found.groups())
    begins, ends = from_h * 60 + from_min, until_h * 60 + until_min
    if max(from_min, until_min) > 59 or max(begins, ends) > _DAY_MINUTES:
        raise InvalidNetwork(path, f"{value!r} leaves the day, 00:00 to 24:00")
    if begins >= ends:
        detail = f"{value!r} ends before it begins; split it at 24:00 if it crosses midnight"
        raise InvalidNetwork(path, detail)
    return begins, ends
