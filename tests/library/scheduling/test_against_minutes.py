"""The calendar agrees with a list of where the drone is, minute by minute, for random standbys."""

from dataclasses import dataclass
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from skyway.delivery.plan import Deliver, Fly, Plan, PlanStatus, Recharge, Step, Wait
from skyway.ids import StationId
from skyway.scheduling.stays import Slot, Stay, first_slot, stay_to_begin_at, stays_of_standby
from skyway.scheduling.trip import Trip, shortened_trip

START_MS = 1_000_000
MINUTE_MS = 60_000
#: The minutes that each list covers; no standby below lasts longer.
MINUTES = range(200)
STATIONS = [StationId(each) for each in "abc"]


@dataclass(frozen=True)
class Minute:
    """Where the drone stands at a minute, None while it flies, and its charge."""

    station_id: StationId | None
    soc: float


@dataclass(frozen=True)
class Standby:
    """A trip that has delivered at a with a charge of 0.5, and then flies, charges and waits."""

    steps: tuple[Step, ...]

    @property
    def trip(self) -> Trip:
        last = Deliver(station_id=STATIONS[0], package_ids=(), start_s=0, end_s=0)
        done = Plan(status=PlanStatus.OPTIMAL, delivery_time_s=0.0, steps=(last,))
        end_s = self.steps[-1].end_s if self.steps else 0.0
        home = Plan(status=PlanStatus.OPTIMAL, delivery_time_s=end_s, steps=self.steps)
        return Trip(START_MS, done, START_MS, home, None)

    def minutes(self) -> list[Minute]:
        """The simple reference: looks at every step for every minute."""
        return [self._at(60.0 * minute) for minute in MINUTES]

    def _at(self, moment_s: float) -> Minute:
        station_id, soc = STATIONS[0], 0.5
        for step, following in pairwise((*self.steps, None)):
            if step is None or moment_s <= step.start_s:
                break
            if isinstance(step, Fly):
                flies_on = isinstance(following, Fly) and moment_s == step.end_s
                if moment_s < step.end_s or flies_on:
                    return Minute(None, soc)
                station_id, soc = step.to_id, step.soc_end
            elif isinstance(step, Recharge):
                share = min(1.0, (moment_s - step.start_s) / (step.end_s - step.start_s))
                soc = step.soc_start + share * (step.soc_end - step.soc_start)
        return Minute(station_id, soc)


@st.composite
def standbys(draw: st.DrawFn) -> Standby:
    """Up to eight steps of whole minutes."""
    steps: list[Step] = []
    place, soc, now_s = STATIONS[0], 0.5, 0.0
    for kind in draw(st.lists(st.sampled_from(["fly", "charge", "wait"]), max_size=8)):
        end_s = now_s + 60.0 * draw(st.integers(1, 20))
        if kind == "fly":
            to = draw(st.sampled_from([each for each in STATIONS if each != place]))
            soc -= 0.04
            members = {"from": place, "to": to, "start_s": now_s, "end_s": end_s}
            steps.append(
                Fly.model_validate({**members, "load_kg": 0, "energy_j": 1, "soc_end": soc})
            )
            place = to
        elif kind == "charge":
            steps.append(
                Recharge(
                    station_id=place,
                    pad=0,
                    start_s=now_s,
                    end_s=end_s,
                    soc_start=soc,
                    soc_end=soc + 0.06,
                )
            )
            soc += 0.06
        else:
            steps.append(Wait(station_id=place, start_s=now_s, end_s=end_s))
        now_s = end_s
    return Standby(tuple(steps))


def stays_of(trip: Trip) -> tuple[Stay, ...]:
    return stays_of_standby(trip.plan, start_ms=START_MS, soc=0.5, home_plan=trip.home_plan)


def moment_ms(minute: int) -> int:
    return START_MS + minute * MINUTE_MS


@given(standbys(), st.sampled_from(MINUTES[:180]))
def test_the_first_slot_is_the_first_minute_on_the_ground(standby: Standby, minute: int) -> None:
    minutes = standby.minutes()

    slot = first_slot(stays_of(standby.trip), not_before_ms=moment_ms(minute))

    landed = next(each for each in MINUTES[minute:] if minutes[each].station_id is not None)
    assert slot is not None
    assert (slot.station_id, slot.at_ms) == (minutes[landed].station_id, moment_ms(landed))
    assert slot.soc == pytest.approx(minutes[landed].soc)


@given(standbys(), st.sampled_from(MINUTES[:180]))
def test_a_standby_that_ends_early_is_as_planned_until_then(standby: Standby, minute: int) -> None:
    slot = first_slot(stays_of(standby.trip), not_before_ms=moment_ms(minute))
    assert slot is not None

    ended = shortened_trip(standby.trip, slot.at_ms)

    cut = Standby(ended.home_plan.steps).minutes()
    count = (slot.at_ms - START_MS) // MINUTE_MS
    for planned, kept in zip(standby.minutes()[:count], cut[:count], strict=True):
        assert kept.station_id == planned.station_id
        assert kept.soc == pytest.approx(planned.soc)
    assert cut[-1].station_id == slot.station_id
    assert cut[-1].soc == pytest.approx(slot.soc)


@given(
    standbys(),
    st.sampled_from(STATIONS),
    st.sampled_from(MINUTES[:180]),
    st.floats(0.1, 0.9),
    st.sampled_from(MINUTES[:180]),
)
def test_a_mission_can_begin_where_the_drone_stands_in_time_with_the_charge(
    standby: Standby, station_id: StationId, minute: int, soc: float, earlier: int
) -> None:
    """A drone that stands there can be kept there, from the moment when it can be instructed."""
    reached = min(earlier, minute)
    planned = Slot(station_id, moment_ms(minute), soc)

    stay = stay_to_begin_at(stays_of(standby.trip), planned, not_left_before_ms=moment_ms(reached))

    stands = [each.station_id == station_id for each in standby.minutes()]
    # It stands there now or lands later, and its charge only rises while it stands.
    socs = [
        each.soc
        for at, each in enumerate(standby.minutes())
        if reached <= at <= minute and stands[at]
    ]
    assert (stay is not None) == (bool(socs) and max(socs) >= soc - 0.005)
