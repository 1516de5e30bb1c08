"""Plans of the sandbox: simple, with honest times. A drone flies to one destination after another.

There is no wind, no waiting for pads and no recharging: the island is small.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise

from skyway.contracts.candidate import Candidate, ProviderReason, ProviderReasonCode
from skyway.contracts.margins import Margins
from skyway.contracts.mission import Mission, PackageEta
from skyway.contracts.quote import OfferTerms
from skyway.contracts.shortlist import Shortlist
from skyway.delivery.offer import BestValues, OfferValues, Price, price_of, rank_offers
from skyway.delivery.plan import Deliver, Fly, PackageDelivery, PickUp, Plan, PlanStatus, Step, Wait
from skyway.delivery.request import DeliveryRequest
from skyway.drone.flight import flight_energy_j, flight_time_s
from skyway.drone.model import DroneModel
from skyway.ids import DeliveryId, MissionId, StationId
from skyway_gateway.sandbox.network import DROPOFF_S, LOADING_S, length_m, way


@dataclass(frozen=True, slots=True)
class Trip:
    """The plan of one drone for a request, its price, and what it is compared by."""

    drone: Candidate
    request: DeliveryRequest
    start_at: datetime
    plan: Plan
    price: Price

    @property
    def etas(self) -> tuple[PackageEta, ...]:
        """When each package is expected."""
        return tuple(
            PackageEta(package_id=each.package_id, eta_at=self.moment(each.delivered_s))
            for each in self.plan.deliveries
        )

    @property
    def values(self) -> OfferValues:
        """What offers are ranked by."""
        return OfferValues(
            time_s=self.plan.delivery_time_s or 0.0,
            price=self.price.amount,
            energy_j=self.plan.energy_j or 0.0,
            provider_id=self.drone.provider_id,
            drone_id=self.drone.drone_id,
        )

    def moment(self, after_s: float) -> datetime:
        """The moment so many seconds after the start."""
        return self.start_at + timedelta(seconds=after_s)

    def terms(self, score: float, *, is_held: bool) -> OfferTerms:
        """The trip as an offer."""
        flights = [each for each in self.plan.steps if isinstance(each, Fly)]
        return OfferTerms(
            provider_id=self.drone.provider_id,
            drone_id=self.drone.drone_id,
            drone_model_id=self.drone.model.model_id,
            price=self.price,
            pickup_station_id=self.request.pickup.station_id,
            pickup_at=self.start_at,
            delivery_time_s=self.plan.delivery_time_s or 0.0,
            packages=self.etas,
            energy_j=self.plan.energy_j or 0.0,
            distance_m=sum(length_m(each.from_id, each.to_id) for each in flights),
            recharges=0,
            recharging_s=0.0,
            waiting_s=self.plan.waiting_s or 0.0,
            ways=((self.request.pickup.station_id, *(each.to_id for each in flights)),),
            margins=Margins(),
            score=score,
            is_held=is_held,
        )

    def mission(self, delivery_id: DeliveryId, mission_id: MissionId, *, attempt: int) -> Mission:
        """The trip as the booked mission of a delivery."""
        return Mission(
            mission_id=mission_id,
            delivery_id=delivery_id,
            attempt=attempt,
            provider_id=self.drone.provider_id,
            drone_id=self.drone.drone_id,
            drone_model_id=self.drone.model.model_id,
            state="BOOKED",
            revision=1,
            start_at=self.start_at,
            price=self.price,
            payment_terms=self.drone.tariff.payment_terms,
            packages=self.etas,
            plan=self.plan,
            pickup_station_id=self.request.pickup.station_id,
            released_at=self.moment(self.plan.delivery_time_s or 0.0),
        )


def ranked_trips(
    request: DeliveryRequest, shortlist: Shortlist, *, now: datetime
) -> tuple[list[tuple[float, Trip]], tuple[ProviderReason, ...]]:
    """The trip of each provider's first drone with its score, the best first; and why others fail.

    `now` is fleet time; a trip begins then, or at the request's earliest pickup.
    """
    firsts = {each.provider_id: each for each in reversed(shortlist.candidates)}
    start_at = max(now, request.earliest_pickup_at or now)
    trips, reasons = list[Trip](), list[ProviderReason]()
    for drone in firsts.values():
        trip = _trip(request, drone, start_at)
        why_not = _broken_limit(trip)
        if why_not is None:
            trips.append(trip)
        else:
            code, detail = why_not
            reasons.append(
                ProviderReason(
                    provider_id=drone.provider_id, code=code, detail=detail, is_temporary=False
                )
            )
    values, ranking = [trip.values for trip in trips], request.qos.ranking
    order = rank_offers(values, ranking)
    best = BestValues.of(values) if values else None
    ranked = [(best.score(values[each], ranking), trips[each]) for each in order if best]
    return ranked, tuple(reasons)


def _trip(request: DeliveryRequest, drone: Candidate, start_at: datetime) -> Trip:
    plan = _plan(request, drone.model, start_at)
    flown = (each for each in plan.steps if isinstance(each, Fly))
    price = price_of(
        drone.tariff,
        distance_m=sum(length_m(each.from_id, each.to_id) for each in flown),
        payload_kg=request.payload_kg,
        recharging_s=0.0,
        priority=request.qos.priority,
    )
    return Trip(drone, request, start_at, plan, price)


def _broken_limit(trip: Trip) -> tuple[ProviderReasonCode, str] | None:
    """The first limit of the request that a trip breaks, in words; None if it keeps all."""
    request, limit = trip.request, trip.request.qos.max_price
    if limit is not None and trip.price.amount > limit:
        return "TOO_EXPENSIVE", f"it costs {trip.price.amount}, which exceeds the limit of {limit}"
    ends = {each.package_id: each.eta_at for each in trip.etas}
    deadline_at = request.qos.deadline_at
    if deadline_at is not None and max(ends.values()) > deadline_at:
        return "TOO_LATE", f"the last package comes at {max(ends.values()):%H:%M:%S}"
    if request.latest_pickup_at is not None:
        loaded_at = trip.moment(LOADING_S)
        if loaded_at > request.latest_pickup_at:
            return "WINDOW_MISSED", f"loading is over at {loaded_at:%H:%M:%S}"
    for package in request.packages:
        if package.latest_at is not None and ends[package.package_id] > package.latest_at:
            comes_at = f"{ends[package.package_id]:%H:%M:%S}"
            return "WINDOW_MISSED", f"package {package.package_id!r} comes at {comes_at}"
    if (trip.plan.energy_j or 0.0) > trip.drone.model.battery_j:
        return "OUT_OF_RANGE", "drones of the sandbox do not recharge: name fewer destinations"
    return None


def _plan(request: DeliveryRequest, model: DroneModel, start_at: datetime) -> Plan:
    steps = tuple(_steps(request, model, start_at))
    handed = [each for each in steps if isinstance(each, Deliver)]
    flown = [each for each in steps if isinstance(each, Fly)]
    time_s = steps[-1].end_s
    return Plan(
        status=PlanStatus.FEASIBLE,
        delivery_time_s=time_s,
        energy_j=sum(each.energy_j for each in flown),
        flight_s=sum(each.end_s - each.start_s for each in flown),
        waiting_s=sum(each.end_s - each.start_s for each in steps if isinstance(each, Wait)),
        recharging_s=0.0,
        steps=steps,
        deliveries=tuple(
            PackageDelivery(
                package_id=package_id, station_id=each.station_id, delivered_s=each.end_s
            )
            for each in handed
            for package_id in each.package_ids
        ),
    )


def _steps(request: DeliveryRequest, model: DroneModel, start_at: datetime) -> Iterator[Step]:
    here, now_s, soc = request.pickup.station_id, LOADING_S, 1.0
    load_kg = {each.package_id: each.mass_kg for each in request.packages}
    yield PickUp(station_id=here, package_ids=tuple(load_kg), start_s=0.0, end_s=now_s)
    for end in _in_order(request):
        for flight in _flights(way(here, end), model, now_s, soc, sum(load_kg.values())):
            yield flight
            now_s, soc = flight.end_s, flight.soc_end
        here, handed = end, [e for e in request.packages if e.destination.station_id == end]
        openings = [each.not_before_at for each in handed if each.not_before_at is not None]
        opens_s = (max(openings) - start_at).total_seconds() if openings else now_s
        if opens_s > now_s:
            yield Wait(station_id=here, start_s=now_s, end_s=opens_s)
            now_s = opens_s
        package_ids = tuple(each.package_id for each in handed)
        yield Deliver(
            station_id=here, package_ids=package_ids, start_s=now_s, end_s=now_s + DROPOFF_S
        )
        now_s += DROPOFF_S
        for package_id in package_ids:
            del load_kg[package_id]


def _in_order(request: DeliveryRequest) -> Sequence[StationId]:
    """The destinations, those whose windows open or close first, first."""
    by_station: Mapping[StationId, list[float]] = {each: [] for each in request.destinations}
    for each in request.packages:
        for moment in (each.latest_at, each.not_before_at):
            if moment is not None:
                by_station[each.destination.station_id].append(moment.timestamp())
    return sorted(by_station, key=lambda each: min(by_station[each], default=float("inf")))


def _flights(
    stations: Sequence[StationId], model: DroneModel, now_s: float, soc: float, load_kg: float
) -> Iterator[Fly]:
    for start, end in pairwise(stations):
        away_m = length_m(start, end)
        took_s = flight_time_s(model, length_m=away_m, load_kg=load_kg)
        energy_j = flight_energy_j(model, length_m=away_m, load_kg=load_kg)
        soc = max(0.0, soc - energy_j / model.battery_j)
        yield Fly(
            from_id=start,
            to_id=end,
            start_s=now_s,
            end_s=now_s + took_s,
            load_kg=load_kg,
            energy_j=energy_j,
            soc_end=soc,
        )
        now_s += took_s
