"""A fake composition that books like the real one and flies nothing."""

from dataclasses import dataclass, field
from datetime import datetime, timedelta

from skyway.contracts.candidate import (
    Candidate,
    ProviderReason,
)
from skyway.contracts.forgotten_deliveries import ForgetDeliveries, KeptDeliveries
from skyway.contracts.margins import Margins
from skyway.contracts.mission import (
    Booking,
    BookMissions,
    Cancellation,
    CancelMissions,
    ClosedDelivery,
    Mission,
    OfferHold,
    PackageEta,
    WithdrawMissions,
)
from skyway.contracts.quote import KeepOffer, KeptOffer, OfferTerms, QuoteAnswer, QuoteQuery
from skyway.contracts.station_check import StationCheck, StationCheckQuery
from skyway.contracts.track import Track
from skyway.delivery.offer import Price
from skyway.delivery.plan import PackageDelivery, Plan, PlanStatus, Recharge
from skyway.delivery.request import DeliveryRequest
from skyway.drone.models import PAPER_SCENARIO
from skyway.geo import Position
from skyway.runtime.clock import ManualClock
from skyway.runtime.errors import Conflict, ServiceUnavailable

#: Stations of the fake networks. No path leads to "island"; "dallas" lies in another network.
STATIONS = ("san-marcos", "mcqueeney", "bulverde", "san-antonio", "island", "dallas")


def make_mission(
    request: DeliveryRequest,
    *,
    delivery_id: str,
    attempt: int,
    drone_id: str,
    start_at: datetime,
    provider_id: str = "prv_1",
    trip: int = 1,
    pickup: tuple[str, float] | None = None,
) -> Mission:
    """One package every ten minutes, from the start on."""
    deliveries = [
        (package.package_id, package.destination.station_id, 600.0 * number)
        for number, package in enumerate(request.packages, start=1)
    ]
    last_s = deliveries[-1][2]
    pickup_station_id, pickup_away_m = pickup or (request.pickup.station_id, 0.0)
    return Mission(
        mission_id=f"msn_{delivery_id[4:]}_{attempt}" + (f"_{trip}" if trip > 1 else ""),
        delivery_id=delivery_id,
        attempt=attempt,
        trip=trip,
        provider_id=provider_id,
        drone_id=drone_id,
        drone_model_id=PAPER_SCENARIO.model_id,
        state="BOOKED",
        revision=1,
        start_at=start_at,
        released_at=start_at + timedelta(seconds=2 * last_s),
        price=Price(amount=1234, currency="USD"),
        pickup_station_id=pickup_station_id,
        pickup_away_m=pickup_away_m,
        packages=tuple(
            PackageEta(package_id=package_id, eta_at=start_at + timedelta(seconds=at_s))
            for package_id, _, at_s in deliveries
        ),
        plan=Plan(
            status=PlanStatus.OPTIMAL,
            delivery_time_s=last_s,
            energy_j=1e6,
            flight_s=last_s,
            waiting_s=0.0,
            recharging_s=0.0,
            deliveries=tuple(
                PackageDelivery(package_id=package_id, station_id=station_id, delivered_s=at_s)
                for package_id, station_id, at_s in deliveries
            ),
            stats={"strategy": "exact", "labels": 7},
        ),
        home_plan=Plan(status=PlanStatus.OPTIMAL, delivery_time_s=last_s, stats={"labels": 3}),
        home_recharge=Recharge(
            station_id=deliveries[-1][1], pad=0, start_s=0, end_s=1, soc_start=0.5, soc_end=1
        ),
    )


def make_terms(request: DeliveryRequest, candidate: Candidate, at: datetime) -> OfferTerms:
    """One package every ten minutes, from a minute after now on."""
    pickup_at = at + timedelta(seconds=60)
    return OfferTerms(
        provider_id=candidate.provider_id,
        drone_id=candidate.drone_id,
        drone_model_id=candidate.model.model_id,
        price=Price(amount=candidate.tariff.base, currency="USD"),
        pickup_station_id=request.pickup.station_id,
        pickup_at=pickup_at,
        delivery_time_s=600.0 * len(request.packages),
        packages=tuple(
            PackageEta(
                package_id=package.package_id, eta_at=pickup_at + timedelta(seconds=600 * number)
            )
            for number, package in enumerate(request.packages, start=1)
        ),
        energy_j=1e6,
        distance_m=1e4,
        recharges=1,
        recharging_s=120.0,
        waiting_s=60.0,
        ways=(),
        margins=Margins(energy_margin=0.15, pad_gap_s=120.0),
        score=1.0,
    )


@dataclass
class FakeComposition:
    """Books once for each (delivery, attempt), and nothing after a delivery is closed."""

    clock: ManualClock
    is_away: bool = False
    is_busy: bool = False
    has_networks: bool = True
    #: The stations that a closure forbids.
    shut: set[str] = field(default_factory=set)
    reasons: list[ProviderReason] = field(default_factory=list)
    #: The margins of every mission.
    margins: Margins = field(default_factory=Margins)
    #: The price and the terms of every mission, by their names.
    priced: dict[str, object] = field(default_factory=dict)
    #: The price of every offer, by its name.
    offered: dict[str, object] = field(default_factory=dict)
    #: How many packages one trip carries; each trip uses another candidate.
    packages_per_trip: int = 100
    #: The pickup of first bookings, and how far it is from that of the request.
    near_pickup: tuple[str, float] | None = None
    #: How long after a booking its missions start.
    starts_after: timedelta = timedelta(seconds=60)
    #: The first trip of each booking, and those after it.
    booked: dict[tuple[str, int], Mission] = field(default_factory=dict)
    further: dict[tuple[str, int], tuple[Mission, ...]] = field(default_factory=dict)
    closed: set[str] = field(default_factory=set)
    quote_queries: list[QuoteQuery] = field(default_factory=list)
    #: The offers that are kept while they are accepted, and why the next ones are lost.
    kept: list[KeepOffer] = field(default_factory=list)
    lost: list[ProviderReason] = field(default_factory=list)
    #: The ids of all holds.
    holds: set[str] = field(default_factory=set)
    #: What each booking asked for, repeated ones included.
    asked: list[BookMissions] = field(default_factory=list)
    #: Packages that are on board, and those that are with their recipients.
    loaded: set[str] = field(default_factory=set)
    delivered: set[str] = field(default_factory=set)
    cancellations: list[CancelMissions] = field(default_factory=list)
    #: The last attempts that were withdrawn, and deliveries that a drone flies already.
    withdrawn: dict[str, int] = field(default_factory=dict)
    has_left: set[str] = field(default_factory=set)
    tracks: dict[str, Track] = field(default_factory=dict)
    #: Deliveries that were deleted, and those that are still needed.
    forgotten: list[str] = field(default_factory=list)
    needed: set[str] = field(default_factory=set)
    #: How many bookings were new: at most one for each attempt.
    booking_count: int = 0

    def trips_of(self, delivery_id: str, attempt: int) -> tuple[Mission, ...]:
        """The missions of one booking."""
        key = delivery_id, attempt
        return (self.booked[key], *self.further.get(key, ()))

    async def must_accept(self, pickup: str) -> None:
        """Every network is open."""

    async def check_stations(self, query: StationCheckQuery) -> StationCheck:
        self._answer()
        if not self.has_networks:
            raise Conflict("NO_NETWORK", "no network is published: skyway network import bundled")
        known = [one for one in query.station_ids if one in STATIONS]
        return StationCheck(
            network_ids={one: "north" if one == "dallas" else "corridor" for one in known},
            positions={one: Position(-98.0, 29.0 + STATIONS.index(one)) for one in known},
            unknown=tuple(one for one in query.station_ids if one not in STATIONS),
            unreachable=tuple(one for one in known if one in ("island", "dallas")),
            closed=tuple(one for one in known if one in self.shut),
        )

    async def quote(self, query: QuoteQuery) -> QuoteAnswer:
        self._answer()
        self.quote_queries.append(query)
        held_until_at = None
        if query.hold is not None:
            if len(self.holds) >= query.hold.most:
                raise Conflict("TOO_MANY_HOLDS", f"the limit is {query.hold.most} quotes")
            self.holds.add(query.hold.hold_id)
            held_until_at = self.clock.wall_now() + timedelta(seconds=query.hold.life_s)
        return QuoteAnswer(
            offers=tuple(
                make_terms(query.request, one, self.clock.now()).model_copy(
                    update={"is_held": query.hold is not None, **self.offered}
                )
                for one in query.candidates
            ),
            infeasible=tuple(self.reasons),
            held_until_at=held_until_at,
        )

    async def keep(self, asked: KeepOffer) -> KeptOffer:
        self._answer()
        self.kept.append(asked)
        if self.lost:
            return KeptOffer(hold=None, reasons=tuple(self.lost))
        held = asked.offer.hold or OfferHold(hold_id=asked.hold_id, number=0)
        self.holds.add(held.hold_id)
        return KeptOffer(hold=held)

    async def release(self, hold_id: str) -> None:
        self._answer()
        self.holds.discard(hold_id)

    async def book(self, delivery_id: str, requested: BookMissions) -> Booking:
        self._answer()
        self.asked.append(requested)
        if (delivery_id, requested.attempt) in self.booked:
            missions = self.trips_of(delivery_id, requested.attempt)
            return Booking(outcome="BOOKED", missions=missions)
        if requested.attempt <= self.withdrawn.get(delivery_id, 0):
            return Booking(outcome="WITHDRAWN")
        if delivery_id in self.closed:
            return Booking(outcome="CLOSED")
        if self.is_busy or not requested.candidates:
            return Booking(outcome="BUSY", reasons=tuple(self.reasons))
        if self.reasons:
            return Booking(outcome="INFEASIBLE", reasons=tuple(self.reasons))
        first, *further = self._trips(delivery_id, requested)
        self.booking_count += 1
        self.booked[delivery_id, requested.attempt] = first
        self.further[delivery_id, requested.attempt] = tuple(further)
        return Booking(outcome="BOOKED", missions=(first, *further))

    def _trips(self, delivery_id: str, requested: BookMissions) -> list[Mission]:
        packages, size = requested.request.packages, self.packages_per_trip
        groups = [packages[start : start + size] for start in range(0, len(packages), size)]
        return [
            make_mission(
                requested.request.model_copy(update={"packages": group}),
                delivery_id=delivery_id,
                attempt=requested.attempt,
                drone_id=candidate.drone_id,
                start_at=self.clock.now() + self.starts_after,
                provider_id=candidate.provider_id,
                trip=trip,
                pickup=self.near_pickup if requested.attempt == 1 else None,
            ).model_copy(update={"margins": self.margins, **self.priced})
            for trip, (group, candidate) in enumerate(
                zip(groups, requested.candidates, strict=False), start=1
            )
        ]

    async def close(self, delivery_id: str) -> ClosedDelivery:
        self._answer()
        missions = tuple(one for one in self._all(delivery_id) if one.state != "REFUSED")
        if missions and delivery_id not in self.closed:
            return ClosedDelivery(is_closed=False, missions=missions)
        self.closed.add(delivery_id)
        return ClosedDelivery(is_closed=True)

    async def cancel(self, delivery_id: str, requested: CancelMissions) -> Cancellation:
        """Packages on board come back; a mission without packages is over."""
        self._answer()
        self.cancellations.append(requested)
        known = {eta.package_id for one in self._all(delivery_id) for eta in one.packages}
        asked = known if requested.package_ids is None else known & set(requested.package_ids)
        released = asked - self.loaded - self.delivered
        for (booked_id, attempt), mission in self.booked.items():
            if booked_id == delivery_id and {p.package_id for p in mission.packages} <= released:
                over = mission.model_copy(update={"state": "CANCELLED"})
                self.booked[booked_id, attempt] = over
        return Cancellation(
            released=tuple(sorted(released)),
            returning=tuple(sorted(asked & self.loaded)),
            too_late=tuple(sorted(asked & self.delivered)),
        )

    async def withdraw(self, delivery_id: str, requested: WithdrawMissions) -> None:
        """Every mission waits in its drone's calendar until its drone `has_left`."""
        self._answer()
        if delivery_id in self.has_left:
            raise Conflict("TOO_LATE", "a drone has its mission already")
        self.withdrawn[delivery_id] = requested.attempt
        for (booked_id, attempt), mission in self.booked.items():
            if booked_id == delivery_id:
                given_up = mission.model_copy(update={"state": "REFUSED"})
                self.booked[booked_id, attempt] = given_up

    async def track(self, delivery_id: str) -> Track:
        self._answer()
        return self.tracks.get(delivery_id, Track(missions=()))

    async def forget(self, asked: ForgetDeliveries) -> KeptDeliveries:
        self._answer()
        self.forgotten += [each for each in asked.delivery_ids if each not in self.needed]
        return KeptDeliveries(kept=tuple(sorted(self.needed.intersection(asked.delivery_ids))))

    def _all(self, delivery_id: str) -> list[Mission]:
        return [
            mission
            for booked_id, attempt in self.booked
            if booked_id == delivery_id
            for mission in self.trips_of(booked_id, attempt)
        ]

    def _answer(self) -> None:
        if self.is_away:
            raise ServiceUnavailable("composition", "it is away in this test")
