"""Where a drone stands after its last hand-over, and where and when its next mission can begin."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, Recharge, Step
from skyway.ids import StationId

#: A charge that is smaller by less than this counts as the planned charge: sensors are no better.
_SAME_SOC = 0.005


@dataclass(frozen=True, slots=True)
class Stay:
    """A drone stands at a station from `from_ms` until `until_ms`, fleet time in milliseconds.

    `until_ms` is None for the last stay: the drone stands there until it is booked again. The
    charge rises from `soc_from` to `soc_until` while the drone charges, and is constant otherwise.
    """

    station_id: StationId
    from_ms: int
    until_ms: int | None
    soc_from: float
    soc_until: float

    def soc_at(self, moment_ms: int) -> float:
        """The least charge at a moment of the stay; linear, because charge curves are concave."""
        if self.until_ms is None or self.until_ms <= self.from_ms:
            return self.soc_from
        share = (moment_ms - self.from_ms) / (self.until_ms - self.from_ms)
        return self.soc_from + min(1.0, max(0.0, share)) * (self.soc_until - self.soc_from)


def stays_of_standby(
    plan: Plan,
    *,
    start_ms: int,
    soc: float | None,
    home_plan: Plan | None = None,
    home_recharge: Recharge | None = None,
) -> tuple[Stay, ...]:
    """The stays of a drone after the last hand-over of a plan, in order; the last has no end.

    Parameters
    ----------
    plan
        The plan up to its last hand-over; its seconds count from `start_ms`.
    soc
        State of charge before the plan, in [0, 1]. None if it is not known; then the plan must say
        it, or there are no stays.
    home_plan, home_recharge
        What the drone does after the plan. Their seconds count from the plan's end.
    """
    ended_ms = start_ms + round((plan.delivery_time_s or 0.0) * 1000)
    standby = [
        step
        for step in (() if home_plan is None else home_plan.steps)
        if not isinstance(step, PickUp | Deliver)
    ]
    if home_recharge is not None:
        standby.append(home_recharge)
    station_id = _last_station(plan.steps) or _first_station(standby)
    soc = _soc_after(plan.steps, _soc_before(standby, soc))
    if station_id is None or soc is None:
        return ()
    return tuple(_stays(standby, station_id, ended_ms, soc))


def _stays(
    standby: Sequence[Step], station_id: StationId, ended_ms: int, soc: float
) -> Iterator[Stay]:
    """The stays between flights; a stay may have no duration before a take-off."""
    since_ms, is_landed = ended_ms, True
    for step, following in zip_longest(standby, standby[1:]):
        start_ms, end_ms = (ended_ms + round(each * 1000) for each in (step.start_s, step.end_s))
        is_flight = isinstance(step, Fly)
        if is_landed and (is_flight or start_ms > since_ms):
            yield Stay(station_id, since_ms, max(since_ms, start_ms), soc, soc)
        if isinstance(step, Fly):
            station_id, soc = step.to_id, step.soc_end
            # Before another flight the drone flies on over the station.
            is_landed = not isinstance(following, Fly)
        elif isinstance(step, Recharge):
            yield Stay(station_id, start_ms, end_ms, step.soc_start, step.soc_end)
            soc = step.soc_end
        else:
            yield Stay(station_id, start_ms, end_ms, soc, soc)
        since_ms = end_ms
    yield Stay(station_id, since_ms, None, soc, soc)


def _last_station(steps: Iterable[Step]) -> StationId | None:
    """Where the last of these steps ends."""
    last: StationId | None = None
    for step in steps:
        last = step.to_id if isinstance(step, Fly) else step.station_id
    return last


def _first_station(steps: Sequence[Step]) -> StationId | None:
    if not steps:
        return None
    first = steps[0]
    return first.from_id if isinstance(first, Fly) else first.station_id


def _soc_before(steps: Iterable[Step], soc: float | None) -> float | None:
    """The charge before these steps, if the first of them that changes it is a recharge."""
    first = next((step for step in steps if isinstance(step, Fly | Recharge)), None)
    return first.soc_start if isinstance(first, Recharge) else soc


def _soc_after(steps: Iterable[Step], soc: float | None) -> float | None:
    for step in steps:
        if isinstance(step, Fly | Recharge):
            soc = step.soc_end
    return soc


def stays_json(stays: Iterable[Stay]) -> str:
    """The stays as JSON: a list of [station_id, from_ms, until_ms, soc_from, soc_until]."""
    return json.dumps(
        [
            [each.station_id, each.from_ms, each.until_ms, each.soc_from, each.soc_until]
            for each in stays
        ],
        separators=(",", ":"),
    )


def read_stays(text: str) -> tuple[Stay, ...]:
    """The stays in this JSON."""
    return tuple(Stay(StationId(place), *numbers) for place, *numbers in json.loads(text))


@dataclass(frozen=True, slots=True)
class Slot:
    """A drone can begin a mission at a station from `at_ms` on, with at least this charge."""

    station_id: StationId
    at_ms: int
    soc: float

    def allows(self, planned: "Slot") -> bool:
        """Whether a mission that was planned from there can begin here: same place, same charge."""
        return self.station_id == planned.station_id and self.soc >= planned.soc - _SAME_SOC


def first_slot(stays: Sequence[Stay], *, not_before_ms: int) -> Slot | None:
    """The earliest slot at or after a moment; None without stays.

    A drone that charges can stop charging at any moment. A drone in flight is free at its next
    landing.
    """
    for stay in stays:
        if stay.until_ms is None or stay.until_ms >= not_before_ms:
            at_ms = max(stay.from_ms, not_before_ms)
            return Slot(stay.station_id, at_ms, stay.soc_at(at_ms))
    return None


def slot_after(stays: Sequence[Stay], *, not_before_ms: int, hand_over_ms: int) -> Slot | None:
    """The earliest slot after a mission with these stays; None without stays.

    The slot begins `hand_over_ms` after the drone has ended the mission.
    """
    slot = first_slot(stays, not_before_ms=not_before_ms - hand_over_ms)
    return None if slot is None else Slot(slot.station_id, slot.at_ms + hand_over_ms, slot.soc)


def stay_to_begin_at(
    stays: Sequence[Stay], planned: Slot, *, not_left_before_ms: int
) -> Stay | None:
    """The stay at which a mission can begin as planned; None when its plan does not fit.

    The drone must be there in time and with the planned charge, and must not leave before
    `not_left_before_ms`: until then it can be instructed to stay.
    """
    for stay in stays:
        is_left = stay.until_ms is not None and stay.until_ms < not_left_before_ms
        if is_left or stay.station_id != planned.station_id or stay.from_ms > planned.at_ms:
            continue
        if stay.soc_at(planned.at_ms) >= planned.soc - _SAME_SOC:
            return stay
    return None
