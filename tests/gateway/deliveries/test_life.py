"""The life of a delivery under any order of reports, cancellations and delays (I5, I6)."""

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from skyway_gateway.deliveries.lifecycle.booking_effects import (
    after_booking,
    after_cancellation,
    after_giving_up,
)
from skyway_gateway.deliveries.lifecycle.delivery import Delivery, PackageStatus, may_follow
from skyway_gateway.deliveries.lifecycle.package_changes import when_overdue
from skyway_gateway.deliveries.lifecycle.progress import Progress
from skyway_gateway.deliveries.lifecycle.report_effects import after_report
from skyway_gateway.deliveries.requests.accept import new_delivery
from skyway_gateway.notifications.delivery_events import LAST_EVENTS

from skyway.contracts.mission import Cancellation, Mission
from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, PackageId, SubjectId
from tests.gateway.peers import make_mission, make_reason

START = datetime(2026, 3, 1, 12, tzinfo=UTC)
PICKUP = "san-marcos"

#: Which of the missions under way is meant.
WHICH = st.integers(0, 11)
under_way = precondition(lambda self: bool(self.flights))


class Flight:
    """A mission as composition sees it: where each of its packages is."""

    def __init__(self, mission: Mission) -> None:
        self.mission, self.state, self.seq = mission, "BOOKED", 0
        self.to_load = {eta.package_id for eta in mission.packages}
        self.on_board: set[PackageId] = set()
        self.handed_over: set[PackageId] = set()


class Life(RuleBasedStateMachine):
    """A delivery, and the missions, reports and cancellations that happen to it."""

    @initialize(count=st.integers(1, 4), troubles=st.integers(0, 4))
    def request(self, count: int, troubles: int) -> None:
        """Up to four packages; `troubles` limits cancellations, refusals and given-up bookings."""
        self.troubles = troubles
        packages = [
            {"package_id": f"p{n}", "mass_kg": 1.0, "destination": {"station_id": f"s{n}"}}
            for n in range(1, count + 1)
        ]
        request = DeliveryRequest.model_validate(
            {"pickup": {"station_id": PICKUP}, "packages": packages}
        )
        self.now, self.drones = START, 0
        self.flights: list[Flight] = []
        self.reported: list[tuple[str, Any]] = []
        self.delivery: Delivery = new_delivery(
            DeliveryId("dlv_1"),
            customer_id=SubjectId("alice"),
            request=request,
            offer=None,
            at=START,
        )

    # What happens.

    @precondition(lambda self: self.delivery.is_queued)
    @rule(cuts=st.lists(st.integers(1, 3), min_size=1, max_size=3))
    def book(self, cuts: list[int]) -> None:
        """Trips with the drawn numbers of packages; packages after the last cut are left over."""
        waiting = [package.package_id for package in self.delivery.waiting_packages]
        flights = []
        for trip, size in enumerate(cuts, start=1):
            group, waiting = waiting[:size], waiting[size:]
            if group:
                flights.append(Flight(self._mission(group, trip)))
        missions = [flight.mission for flight in flights]
        self._happen(lambda now: after_booking(now, missions, at=self.now))
        self.flights += flights

    @precondition(lambda self: self.delivery.is_queued and self.troubles > 0)
    @rule()
    def give_up(self) -> None:
        self.troubles -= 1
        reasons = [make_reason("BUSY", is_temporary=True)]
        self._happen(lambda now: after_giving_up(now, reasons, detail="no drone", at=self.now))

    @under_way
    @rule(which=WHICH)
    def accept(self, which: int) -> None:
        self._accept(self._flight(which))

    @precondition(lambda self: bool(self.flights) and self.troubles > 0)
    @rule(which=WHICH)
    def refuse_or_abort(self, which: int) -> None:
        self.troubles -= 1
        flight = self._flight(which)
        self.flights.remove(flight)
        if flight.state in ("BOOKED", "ACCEPTED"):
            flight.state = "REFUSED"
            self._report(flight, "REFUSED", code="EXPIRED")
        else:
            self._end(flight, "ABORTED", code="NO_PLAN")

    @under_way
    @rule(which=WHICH)
    def load(self, which: int) -> None:
        flight = self._flight(which)
        self._accept(flight)
        if flight.state == "ACCEPTED" and flight.to_load:
            flight.state = "ACTIVE"
            self._report(flight, "LOADING")
            flight.on_board, flight.to_load = flight.to_load, set()
            self._report(flight, "LOADED", package_ids=sorted(flight.on_board))

    @under_way
    @rule(which=WHICH, activity=st.sampled_from(["FLYING", "WAITING"]))
    def move(self, which: int, activity: str) -> None:
        self._report(self._flight(which), "ACTIVITY", activity=activity)

    @under_way
    @rule(which=WHICH, late_s=st.integers(-600, 6000))
    def replan(self, which: int, late_s: int) -> None:
        flight = self._flight(which)
        self._report(flight, "REPLANNING", code="ZONE")
        etas = [
            {"package_id": eta.package_id, "eta_at": eta.eta_at + timedelta(seconds=late_s)}
            for eta in flight.mission.packages
        ]
        self._report(flight, "REPLANNED", code="ZONE", etas=etas)

    @under_way
    @rule(which=WHICH, kind=st.sampled_from(["DELIVERED", "RETURNED"]))
    def hand_over(self, which: int, kind: str) -> None:
        flight = self._flight(which)
        if flight.on_board:
            package_id = min(flight.on_board)
            flight.on_board.remove(package_id)
            flight.handed_over.add(package_id)
            if kind == "RETURNED":
                self._report(flight, "RETURNING", package_ids=[package_id], code="ABSENT")
            self._report(flight, kind, package_ids=[package_id], station_id=PICKUP)

    @under_way
    @rule(which=WHICH, kind=st.sampled_from(["DELIVERED", "RETURNED", "RETURNING", "LOADED"]))
    def say_it_otherwise(self, which: int, kind: str) -> None:
        """Reports about settled packages change nothing."""
        flight = self._flight(which)
        if flight.handed_over:
            self._report(flight, kind, package_ids=sorted(flight.handed_over), station_id=PICKUP)

    @under_way
    @rule(which=WHICH, is_seen=st.booleans())
    def come_home(self, which: int, *, is_seen: bool) -> None:
        """The drone comes home, or goes down with its packages."""
        flight = self._flight(which)
        self.flights.remove(flight)
        is_done = flight.state == "ACTIVE" and not flight.on_board
        self._end(flight, "COMPLETED" if is_done else "ABORTED", code="HOME", is_seen=is_seen)

    @precondition(lambda self: self.troubles > 0)
    @rule(
        requested=st.sets(st.sampled_from(["p1", "p2", "p3", "p4"]), min_size=1),
        is_in_time=st.booleans(),
    )
    def cancel(self, requested: set[PackageId], *, is_in_time: bool) -> None:
        """A package that is cancelled too late to stay is loaded and brought back."""
        self.troubles -= 1
        to_load = set().union(*(flight.to_load for flight in self.flights)) & requested
        on_board = set().union(*(flight.on_board for flight in self.flights)) & requested
        released = to_load if is_in_time else set()
        returning = (to_load | on_board) - released
        done = Cancellation(released=tuple(sorted(released)), returning=tuple(sorted(returning)))
        self._happen(
            lambda now: after_cancellation(
                now, requested, done, reason="no need", at=self.now, host_delay=timedelta()
            )
        )
        for flight in self.flights:
            off = sorted(flight.to_load & released)
            back = sorted((flight.to_load | flight.on_board) & returning)
            flight.to_load -= released
            for kind, package_ids in (("RELEASED", off), ("RETURNING", back)):
                if package_ids:
                    self._report(flight, kind, package_ids=package_ids, code="CANCELLED")

    @rule()
    def say_nothing(self) -> None:
        """Time passes until the delivery is late."""
        self.now += timedelta(minutes=20)
        self._happen(lambda now: Progress(*when_overdue(now, at=self.now, host_delay=timedelta())))

    # What holds.

    @invariant()
    def it_is_over_exactly_when_all_its_packages_are(self) -> None:
        assert self.delivery.is_over == all(one.is_settled for one in self.delivery.packages)

    @invariant()
    def it_has_reported_one_last_event_exactly_when_it_is_over(self) -> None:
        last = [number for number, (kind, _) in enumerate(self.reported) if kind in LAST_EVENTS]
        assert last == ([len(self.reported) - 1] if self.delivery.is_over else [])

    @invariant()
    def each_package_has_reported_its_end_once(self) -> None:
        if self.delivery.state == "REJECTED":
            return
        ends = [data["package_id"] for kind, data in self.reported if kind.startswith("package.")]
        settled = [one.package_id for one in self.delivery.packages if one.is_settled]
        assert sorted(ends) == settled

    @invariant()
    def while_it_goes_on_a_mission_carries_it_or_it_is_queued(self) -> None:
        if not self.delivery.is_over:
            assert self.delivery.is_queued or self.delivery.live_missions

    @invariant()
    def each_package_on_its_way_has_one_live_mission(self) -> None:
        live = {mission.mission_id for mission in self.delivery.live_missions}
        for package in self.delivery.packages:
            if not package.is_settled and not package.is_waiting:
                assert package.mission_id in live

    @invariant()
    def each_package_is_with_whom_its_state_says(self) -> None:
        station, drone, recipient = {"STATION"}, {"DRONE"}, {"RECIPIENT"}
        kinds = {
            "CREATED": station,
            "CANCELLED": station,
            "RETURNED": station,
            "DELIVERED": recipient,
            "STRANDED": station | drone,
        }
        for package in self.delivery.packages:
            assert package.custodian.kind in kinds.get(package.state, drone)

    @invariant()
    def each_mission_is_charged_exactly_when_its_packages_are_settled(self) -> None:
        for mission in self.delivery.missions:
            own = [each for each in self.delivery.packages if each.mission_id == mission.mission_id]
            is_settled = bool(own) and all(each.is_settled for each in own)
            if mission.state != "REFUSED":
                assert (mission.charged is not None) == is_settled
            assert mission.owed.amount <= mission.price.amount

    @invariant()
    def the_price_is_the_sum_of_what_is_owed(self) -> None:
        owed = sum(mission.owed.amount for mission in self.delivery.missions)
        assert (self.delivery.price.amount if self.delivery.price else 0) == owed

    # How it happens.

    def _mission(self, package_ids: list[PackageId], trip: int) -> Mission:
        self.drones += 1
        request = self.delivery.request
        packages = tuple(one for one in request.packages if one.package_id in package_ids)
        return make_mission(
            request.model_copy(update={"packages": packages}),
            delivery_id="dlv_1",
            attempt=self.delivery.attempt,
            trip=trip,
            drone_id=f"drn_{self.drones}",
            start_at=self.now,
        )

    def _accept(self, flight: Flight) -> None:
        if flight.state == "BOOKED":
            flight.state = "ACCEPTED"
            self._report(flight, "ACCEPTED")

    def _flight(self, which: int) -> Flight:
        return self.flights[which % len(self.flights)]

    def _end(self, flight: Flight, state: str, *, code: str, is_seen: bool = True) -> None:
        flight.state = state
        stranded, flight.on_board = sorted(flight.on_board), set()
        where = {"stranded_package_ids": stranded, "station_id": "bulverde"} if is_seen else {}
        self._report(flight, "ENDED", code=code, **where)

    def _report(self, flight: Flight, kind: str, **fields: object) -> None:
        flight.seq += 1
        mission = flight.mission
        report = MissionReport.model_validate(
            {
                "report_id": f"rpt_{flight.seq}",
                "delivery_id": "dlv_1",
                "attempt": mission.attempt,
                "trip": mission.trip,
                "mission_id": mission.mission_id,
                "provider_id": mission.provider_id,
                "drone_id": mission.drone_id,
                "seq": flight.seq,
                "kind": kind,
                "at": self.now,
                "mission_state": flight.state,
                **fields,
            }
        )
        self._happen(lambda now: after_report(now, report, host_delay=timedelta()), is_report=True)

    def _happen(self, change: Callable[[Delivery], Progress], *, is_report: bool = False) -> None:
        """Apply a change as `write_delivery` does: a delivery that is over does not change."""
        self.now += timedelta(seconds=30)
        before = self.delivery
        if before.is_over and not is_report:
            return
        progress = change(before)
        assert may_follow(progress.delivery.state, before.state)
        for then, now in zip(before.packages, progress.delivery.packages, strict=True):
            _check_package(then, now)
        charged = {each.mission_id: each.charged for each in before.missions if each.charged}
        for mission in progress.delivery.missions:
            assert charged.get(mission.mission_id) in (None, mission.charged), "charged again"
        self.delivery = progress.delivery
        self.reported += [
            (happening.type.value, happening.data) for happening in progress.happenings
        ]


def _check_package(before: PackageStatus, after: PackageStatus) -> None:
    if before.is_settled:
        assert after == before
    if before.mission_id is not None and after.mission_id != before.mission_id:
        assert after.mission_id is None, "handed from mission to mission"
        assert before.state == "CREATED"


def test_a_delivery_always_ends_once_and_loses_no_package() -> None:
    run_state_machine_as_test(Life, settings=settings(max_examples=200, stateful_step_count=30))
