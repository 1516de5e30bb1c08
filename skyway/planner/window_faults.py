"""Where the windows of a problem contradict themselves or one another."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from skyway.errors import FieldFault
from skyway.ids import StationId
from skyway.planner.problem_parts import PackageToDeliver
from skyway.units import TIME_TOLERANCE_S


@dataclass(frozen=True, slots=True)
class TimedAct:
    """Loading or a hand-over: its window, None without a limit, and how long it takes, seconds."""

    not_before_s: float | None
    latest_s: float | None
    takes_s: float


def window_faults(
    packages: Sequence[PackageToDeliver], *, loading: TimedAct, dropoff_s: float
) -> Iterator[FieldFault]:
    """Each window that is reversed or too short, and each pair for one station that cannot meet."""
    detail = _contradiction(loading, "pickup_not_before_s", act="loading")
    if detail is not None:
        yield FieldFault("pickup_latest_s", detail)
    is_good = True
    for number, package in enumerate(packages):
        window = TimedAct(package.not_before_s, package.latest_s, dropoff_s)
        detail = _contradiction(window, "not_before_s", act="the hand-over")
        if detail is not None:
            is_good = False
            yield FieldFault(f"packages.{number}.latest_s", detail)
    if is_good:
        yield from _of_shared_stations(packages, dropoff_s)


def _contradiction(window: TimedAct, first_field: str, *, act: str) -> str | None:
    if window.not_before_s is None or window.latest_s is None:
        return None
    room_s = window.latest_s - window.not_before_s
    if room_s < 0:
        return f"{window.latest_s:g} is before {first_field} {window.not_before_s:g}"
    if room_s < window.takes_s - TIME_TOLERANCE_S:
        return f"{room_s:g} s after {first_field}, {act} takes {window.takes_s:g} s"
    return None


def _of_shared_stations(
    packages: Sequence[PackageToDeliver], dropoff_s: float
) -> Iterator[FieldFault]:
    """Packages for one station are handed over together, so their windows must overlap."""
    latest_to_begin: dict[StationId, tuple[float, int]] = {}
    soonest_to_end: dict[StationId, tuple[float, int]] = {}
    for number, package in enumerate(packages):
        here = package.destination
        if package.not_before_s is not None:
            one = (package.not_before_s, number)
            latest_to_begin[here] = max(latest_to_begin.get(here, one), one)
        if package.latest_s is not None:
            one = (package.latest_s, number)
            soonest_to_end[here] = min(soonest_to_end.get(here, one), one)
    for station_id, (latest_s, number) in soonest_to_end.items():
        not_before_s, other = latest_to_begin.get(station_id, (latest_s - dropoff_s, number))
        room_s = latest_s - not_before_s
        if room_s < dropoff_s - TIME_TOLERANCE_S:
            yield FieldFault(
                f"packages.{number}.latest_s",
                f"{latest_s:g} is {dropoff_s - room_s:g} s too early for packages.{other}, which "
                f"goes to {station_id!r} too and is handed over with it, not before "
                f"{not_before_s:g}",
            )
