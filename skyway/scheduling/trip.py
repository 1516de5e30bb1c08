"""A trip of one drone in fleet time: approach, delivery, standby, and the pads it reserves.

Its standby may be ended early, for the next mission of the drone.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final

from skyway.contracts.candidate import ProviderReasonCode
from skyway.delivery.plan import Fly, Plan, PlanStatus, Recharge, Step, Wait
from skyway.ids import StationId
from skyway.planner.pad_book import booked_from_ms, booked_until_ms
from skyway.units import ms_to_moment

#: Moments that differ by less count as the same, in milliseconds: plans round them differently.
SAME_MS: Final = 2

#: The plan of a drone without packages left to deliver.
NOTHING_TO_DELIVER: Final = Plan(
    status=PlanStatus.OPTIMAL,
    delivery_time_s=0.0,
    lower_bound_s=0.0,
    energy_j=0.0,
    flight_s=0.0,
    waiting_s=0.0,
    recharging_s=0.0,
)


@dataclass(frozen=True, slots=True, order=True)
class BookedPad:
    """One pad of one station, reserved in [start_ms, end_ms) of fleet time."""

    station_id: StationId
    pad: int
    start_ms: int
    end_ms: int


def without(sessions: Iterable[BookedPad], others: Iterable[BookedPad]) -> tuple[BookedPad, ...]:
    """What is left of these sessions when others use the same pads for some of the time."""
    left = [*sessions]
    for other in others:
        left = [part for session in left for part in _parts_beside(session, other)]
    return tuple(left)


def _parts_beside(session: BookedPad, other: BookedPad) -> Iterator[BookedPad]:
    """The parts of a session before and after another one of the same pad."""
    is_same_pad = (session.station_id, session.pad) == (other.station_id, other.pad)
    if not is_same_pad or other.end_ms <= session.start_ms or session.end_ms <= other.start_ms:
        yield session
        return
    if session.start_ms < other.start_ms:
        yield replace(session, end_ms=other.start_ms)
    if other.end_ms < session.end_ms:
        yield replace(session, start_ms=other.end_ms)


def merged(sessions: Iterable[BookedPad]) -> tuple[BookedPad, ...]:
    """One mission's sessions, sorted; sessions that touch on one pad become one session.

    The order is the same in every booking. Otherwise two bookings could lock each other's rows
    crosswise and wait for each other.
    """
    held: list[BookedPad] = []
    for session in sorted(sessions):
        last = held[-1] if held else None
        if (
            last is not None
            and (last.station_id, last.pad) == (session.station_id, session.pad)
            and session.start_ms <= last.end_ms
        ):
            end_ms = max(last.end_ms, session.end_ms)
            held[-1] = BookedPad(last.station_id, last.pad, last.start_ms, end_ms)
        else:
            held.append(session)
    return tuple(held)


@dataclass(frozen=True, slots=True)
class NoTrip:
    """Why there is no trip; `is_temporary` when other reservations may be the cause.

    `data` holds the numbers behind the code, by name. `missed_at` is the station of a window that
    is missed.
    """

    code: ProviderReasonCode
    detail: str
    is_temporary: bool
    data: tuple[tuple[str, float | str], ...] = ()
    missed_at: StationId | None = None


@dataclass(frozen=True, slots=True)
class PlacedStep:
    """A step of a plan, and the moment from which the step's seconds count."""

    base_ms: int
    step: Step

    @property
    def start_at(self) -> datetime:
        """When the step is planned to begin."""
        return ms_to_moment(self.base_ms) + timedelta(seconds=self.step.start_s)

    @property
    def end_at(self) -> datetime:
        """When the step is planned to end."""
        return ms_to_moment(self.base_ms) + timedelta(seconds=self.step.end_s)

    @property
    def start_ms(self) -> int:
        """The millisecond from which the step is booked."""
        return self.base_ms + booked_from_ms(self.step.start_s)

    @property
    def end_ms(self) -> int:
        """The millisecond until which the step is booked."""
        return self.base_ms + booked_until_ms(self.step.end_s)


@dataclass(frozen=True, slots=True)
class Trip:
    """`plan` counts from `start_ms`; `home_plan` and `home_recharge` count from `home_start_ms`.

    The last two are the standby: the flight to where the drone stands by, which may be its home,
    and the recharge there. The home plan's PICK_UP and DELIVER of a 0 kg package are not part of
    the trip's steps. Each pad is booked `pad_gap_ms` longer than the drone needs it.
    """

    start_ms: int
    plan: Plan
    home_start_ms: int
    home_plan: Plan
    home_recharge: Recharge | None
    pad_gap_ms: int = 0

    def steps(self) -> Iterator[PlacedStep]:
        """Everything the drone does, in time order."""
        for step in self.plan.steps:
            yield PlacedStep(self.start_ms, step)
        for step in self.home_plan.steps:
            if step.kind not in ("PICK_UP", "DELIVER"):
                yield PlacedStep(self.home_start_ms, step)
        if self.home_recharge is not None:
            yield PlacedStep(self.home_start_ms, self.home_recharge)

    @property
    def booked_pads(self) -> tuple[BookedPad, ...]:
        """The pads to reserve: sessions rounded to whole ms, with their gap, merged and sorted."""
        return merged(
            BookedPad(
                placed.step.station_id,
                placed.step.pad,
                placed.start_ms,
                placed.end_ms + self.pad_gap_ms,
            )
            for placed in self.steps()
            if isinstance(placed.step, Recharge) and placed.start_ms < placed.end_ms
        )

    @property
    def released_ms(self) -> int:
        """The moment at which the drone is planned to be free again."""
        return max((placed.end_ms for placed in self.steps()), default=self.home_start_ms)


def soc_after(plan: Plan, soc: float) -> float:
    """State of charge at the end of a plan that begins with `soc`."""
    for step in plan.steps:
        if isinstance(step, Fly | Recharge):
            soc = step.soc_end
    return soc


def no_plan(plan: Plan) -> NoTrip:
    """Why there is no trip, from a plan that cannot be flown."""
    if plan.infeasibility is None:
        return NoTrip("NO_PLAN_FOUND", "no plan was found in time", is_temporary=True)
    why = plan.infeasibility
    return NoTrip(
        why.code,
        why.detail,
        is_temporary=why.code == "NO_PAD_IN_TIME",
        data=() if why.late_s is None else (("late_s", why.late_s),),
        missed_at=why.station_id,
    )


def shortened_trip(trip: Trip, until_ms: int) -> Trip:
    """The trip whose standby ends at a moment, which is not before its last delivery."""
    until_s = (until_ms - trip.home_start_ms) / 1000
    home_plan, home_recharge = trip.home_plan, trip.home_recharge
    if (home_plan.delivery_time_s or 0.0) > until_s:
        home_plan = shortened_plan(home_plan, until_s)
    if home_recharge is not None:
        shortened = shortened_step(home_recharge, until_s)
        home_recharge = shortened if isinstance(shortened, Recharge) else None
    return replace(trip, home_plan=home_plan, home_recharge=home_recharge)


def shortened_plan(plan: Plan, until_s: float) -> Plan:
    """The plan up to a moment, in seconds since its start; its deliveries are left out."""
    steps = tuple(
        kept for step in plan.steps if (kept := shortened_step(step, until_s)) is not None
    )
    flights = [each for each in steps if isinstance(each, Fly)]
    return plan.model_copy(
        update={
            "steps": steps,
            "deliveries": (),
            "delivery_time_s": steps[-1].end_s if steps else 0.0,
            "energy_j": sum(each.energy_j for each in flights),
            "flight_s": _seconds(flights),
            "waiting_s": _seconds([each for each in steps if isinstance(each, Wait)]),
            "recharging_s": _seconds([each for each in steps if isinstance(each, Recharge)]),
        }
    )


def _seconds(steps: Sequence[Step]) -> float:
    return sum(each.end_s - each.start_s for each in steps)


def shortened_step(step: Step, until_s: float) -> Step | None:
    """The step up to a moment; None when it begins later."""
    same_s = SAME_MS / 1000
    if step.end_s <= until_s + same_s:
        return step
    if step.start_s >= until_s - same_s:
        return None
    update = {"end_s": until_s}
    if isinstance(step, Recharge):
        share = (until_s - step.start_s) / (step.end_s - step.start_s)
        # Charge curves are concave, so the drone has at least this.
        soc = step.soc_start + share * (step.soc_end - step.soc_start)
        return step.model_copy(update={**update, "soc_end": soc})
    return step.model_copy(update=update)
