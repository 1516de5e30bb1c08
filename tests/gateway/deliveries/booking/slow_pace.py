"""Rounds of booking that take as long as a test says."""

from collections.abc import Callable

from skyway_gateway.deliveries.booking.booking_round import RoundPace


class Seconds:
    """Seconds that pass when a test says so."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


def slow_pace(
    round_s: float, *, most: int = 4, now_s: Callable[[], float] | None = None
) -> RoundPace:
    """A pace at which each round alone has taken so many seconds."""
    seconds = Seconds()
    pace = RoundPace(most, now_s=now_s or seconds)
    for _ in range(8):
        begun_s = pace.begin()
        seconds.now_s += round_s
        pace.end(begun_s)
    return pace
