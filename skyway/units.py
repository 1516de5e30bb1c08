"""Conversions at the edge, and the tolerances with which quantities are compared."""

from datetime import UTC, datetime, timedelta

#: Charges closer than this share of a full battery are equal (docs/reference/planner-problem.md).
CHARGE_TOLERANCE = 1e-9

#: Two moments closer than this many seconds are equal, and beside that closer than this share of
#: the seconds since the start: floats of decades lose microseconds
#: (docs/reference/planner-problem.md).
TIME_TOLERANCE_S = 1e-6
TIME_TOLERANCE_SHARE = 1e-15

#: Two loads closer than this many kilograms are equal; they are sums of the same masses.
LOAD_TOLERANCE_KG = 1e-9

#: A moment that never comes, in milliseconds since 1970.
NEVER_MS = 2**53

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def time_tolerance_s(moment_s: float) -> float:
    """Moments closer than this to such a moment are equal to it. Searches use half of it."""
    return TIME_TOLERANCE_S + TIME_TOLERANCE_SHARE * abs(moment_s)


def kmh_to_mps(speed_kmh: float) -> float:
    """Kilometres per hour as metres per second."""
    return speed_kmh / 3.6


def km_to_m(distance_km: float) -> float:
    """Kilometres as metres."""
    return distance_km * 1000.0


def m_to_km(distance_m: float) -> float:
    """Metres as kilometres, for people to read."""
    return distance_m / 1000.0


def wh_to_j(energy_wh: float) -> float:
    """Watt-hours as joules."""
    return energy_wh * 3600.0


def minutes_to_s(duration_min: float) -> float:
    """Minutes as seconds."""
    return duration_min * 60.0


def hours_to_s(duration_h: float) -> float:
    """Hours as seconds."""
    return duration_h * 3600.0


def moment_to_ms(moment: datetime) -> int:
    """Whole milliseconds since 1970, the form in which databases and pad calendars keep moments."""
    return (moment - _EPOCH) // timedelta(milliseconds=1)


def ms_to_moment(moment_ms: int) -> datetime:
    """The UTC moment of whole milliseconds since 1970."""
    return _EPOCH + timedelta(milliseconds=moment_ms)
