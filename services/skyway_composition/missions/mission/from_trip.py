"""From a planned trip to a mission, and to the steps that a drone can fly alone."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from itertools import zip_longest
from typing import Any, Self

from skyway.contracts.candidate import Candidate
from skyway.contracts.flight_step import (
    AwaitedProof,
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    ReturnStep,
    WaitStep,
)
from skyway.contracts.mission import Mission, PackageEta
from skyway.contracts.network_document import NetworkSettings
from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, Recharge, Wait
from skyway.delivery.verification import PlannedVerification
from skyway.ids import DeliveryId, MissionId, PackageId, StationId
from skyway.network.network import Network, Segment
from skyway.runtime.tracing import current_traceparent
from skyway.scheduling.stays import Slot
from skyway.scheduling.trip import PlacedStep, Trip
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.networks.store import Present
from skyway_composition.planning.offer import Part
from skyway_composition.planning.problem_for import margins_of
from skyway_composition.planning.world import World


@dataclass(frozen=True, slots=True)
class StepTerms:
    """What the steps of a mission need beyond its plan.

    A hand-over takes `dropoff_s`; the time for a proof in the plan comes before. A drone waits for
    the proof of a package in `verified` for `proof_wait_s` at least. At the stops where the plan
    delivers the packages in `returned`, they are handed back.
    """

    masses_kg: Mapping[PackageId, float]
    recipient_wait_s: float = 0.0
    dropoff_s: float = math.inf
    proof_wait_s: float = 0.0
    verified: Mapping[PackageId, PlannedVerification] = field(default_factory=dict)
    awaits_confirmation: bool = False
    returned: frozenset[PackageId] = frozenset()

    @classmethod
    def of(
        cls,
        record: MissionRecord,
        settings: NetworkSettings,
        *,
        proof_wait: timedelta = timedelta(),
    ) -> Self:
        """The terms of a mission in a network with these settings."""
        return cls(
            masses_kg={each.package_id: each.mass_kg for each in record.request.packages},
            recipient_wait_s=settings.recipient_wait_s,
            dropoff_s=settings.dropoff_s,
            proof_wait_s=proof_wait.total_seconds(),
            verified={
                each.package_id: each.dropoff_verification
                for each in record.request.packages
                if each.dropoff_verification is not None
            },
            awaits_confirmation=record.mission.loading == "AWAITED",
            returned=frozenset(each.package_id for each in record.aims if each.kind == "RETURN"),
        )


def flight_steps(
    network: Network,
    placed_steps: Sequence[PlacedStep],
    *,
    terms: StepTerms,
    first_step: int,
) -> tuple[FlightStep, ...]:
    """The steps of a trip with all that a drone needs, numbered from `first_step`.

    A FLY lands unless another FLY follows. A RECHARGE may use its pad for the reserved time: the
    planned time, rounded outward to whole milliseconds.
    """
    following = placed_steps[1:]
    steps: list[FlightStep] = []
    for placed, after in zip_longest(placed_steps, following):
        step_id = first_step + len(steps)
        steps.extend(_flight_steps(network, placed, after, terms=terms, step_id=step_id))
    return tuple(steps)


def finished_wait(station_id: StationId, at_ms: int, *, step_id: int) -> WaitStep:
    """A wait of no duration."""
    at = ms_to_moment(at_ms)
    return WaitStep(
        step_id=step_id,
        planned_start_at=at,
        planned_end_at=at,
        station_id=station_id,
        until_at=at,
    )


def _hand_overs(
    placed: PlacedStep, step: Deliver, *, terms: StepTerms, step_id: int
) -> Iterator[FlightStep]:
    """The hand-overs at one stop: first returned packages, then deliveries, within one time."""
    start_at, end_at = placed.start_at, placed.end_at
    returned = tuple(each for each in step.package_ids if each in terms.returned)
    delivered = tuple(each for each in step.package_ids if each not in terms.returned)
    if returned:
        yield ReturnStep(
            step_id=step_id,
            planned_start_at=start_at,
            planned_end_at=start_at if delivered else end_at,
            station_id=step.station_id,
            package_ids=returned,
        )
    if delivered:
        yield DeliverStep(
            step_id=step_id + 1 if returned else step_id,
            planned_start_at=start_at,
            planned_end_at=end_at,
            station_id=step.station_id,
            package_ids=delivered,
            dropoff_s=min(step.end_s - step.start_s, terms.dropoff_s),
            **_waiting(delivered, terms),
        )


def _waiting(package_ids: Sequence[PackageId], terms: StepTerms) -> dict[str, Any]:
    """The fields of a DELIVER about its wait. Any: a tuple and a number."""
    asked = {each: terms.verified[each] for each in package_ids if each in terms.verified}
    if not asked:
        return {"recipient_wait_s": terms.recipient_wait_s}
    waits_s = [each.waits_s(terms.recipient_wait_s) for each in asked.values()]
    return {
        "recipient_wait_s": max(terms.proof_wait_s, *waits_s),
        "verification": tuple(
            AwaitedProof(package_id=name, method=each.method, upload_path=each.upload_path)
            for name, each in asked.items()
        ),
    }


def _flight_steps(
    network: Network,
    placed: PlacedStep,
    following: PlacedStep | None,
    *,
    terms: StepTerms,
    step_id: int,
) -> Iterator[FlightStep]:
    start_at, end_at = placed.start_at, placed.end_at
    match placed.step:
        case PickUp() as step:
            yield PickUpStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                packages=tuple(
                    PackageOnBoard(package_id=package_id, mass_kg=terms.masses_kg[package_id])
                    for package_id in step.package_ids
                ),
                awaits_confirmation=terms.awaits_confirmation,
            )
        case Fly() as step:
            yield FlyStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                from_id=step.from_id,
                to_id=step.to_id,
                from_position=network.stations[step.from_id].position,
                to_position=network.stations[step.to_id].position,
                length_m=_segment(network, step.from_id, step.to_id).length_m,
                lands=following is None or not isinstance(following.step, Fly),
                time_factor=step.time_factor,
                energy_factor=step.energy_factor,
            )
        case Wait() as step:
            yield WaitStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                until_at=end_at,
            )
        case Recharge() as step:
            yield RechargeStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                pad=step.pad,
                not_before_at=ms_to_moment(placed.start_ms),
                until_soc=step.soc_end,
                not_after_at=ms_to_moment(placed.end_ms),
                power_w=step.power_w,
            )
        case Deliver() as step:
            yield from _hand_overs(placed, step, terms=terms, step_id=step_id)


def _segment(network: Network, from_id: StationId, to_id: StationId) -> Segment:
    return next(each for each in network.segments_from(from_id) if each.to_id == to_id)


def new_mission(
    part: Part,
    world: World,
    *,
    delivery_id: DeliveryId,
    attempt: int,
    trip_number: int,
    mission_id: MissionId,
    expires_at: datetime,
    planned_in: Present | None,
    firm_at: datetime | None,
) -> MissionRecord:
    """The record of a new mission that flies a part of an offer; QUEUED if `planned_in` is given.

    The first instruction expires at `expires_at`. The promise of a QUEUED mission becomes firm at
    `firm_at`, or is firm already.
    """
    candidate, trip, request = part.candidate, part.trip, part.request
    start_at = ms_to_moment(trip.start_ms)
    mission = Mission(
        mission_id=mission_id,
        delivery_id=delivery_id,
        attempt=attempt,
        trip=trip_number,
        provider_id=candidate.provider_id,
        drone_id=candidate.drone_id,
        drone_model_id=candidate.model.model_id,
        state="BOOKED" if planned_in is None else "QUEUED",
        revision=1,
        start_at=start_at,
        released_at=ms_to_moment(trip.released_ms),
        price=part.price,
        payment_terms=candidate.tariff.payment_terms,
        packages=_etas(trip.plan, start_at),
        plan=trip.plan,
        pickup_station_id=request.pickup.station_id,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
        margins=margins_of(world, candidate, trip),
        weather=world.weather_note(trip.start_ms),
        loading="AWAITED" if candidate.loading == "CONFIRMED" else "AUTOMATIC",
        firm_at=None if planned_in is None else firm_at,
    )
    return MissionRecord(
        mission=mission,
        network_id=world.skyway.network_id,
        request=request,
        candidate=candidate,
        expires_ms=moment_to_ms(expires_at),
        planned_in=planned_in,
        traceparent=current_traceparent(),
        promised=() if planned_in is None else mission.packages,
    )


def flown_by(record: MissionRecord, candidate: Candidate) -> MissionRecord:
    """A QUEUED mission with another drone; its price and its terms stay."""
    drone = {
        "provider_id": candidate.provider_id,
        "drone_id": candidate.drone_id,
        "drone_model_id": candidate.model.model_id,
    }
    names = ("provider_id", "drone_id", "model", "home_station_id", "standby", "learned")
    changed = {name: getattr(candidate, name) for name in names}
    return replace(
        record,
        mission=record.mission.model_copy(update=drone),
        candidate=record.candidate.model_copy(update=changed),
    )


def replanned_in_queue(
    record: MissionRecord, trip: Trip, slot: Slot, *, world: World
) -> MissionRecord:
    """A QUEUED mission with another trip, which begins at this slot; the price stays."""
    place = {"station_id": slot.station_id, "soc": slot.soc}
    return replace(
        record,
        mission=next_revision(record, trip, world, revision=1),
        candidate=record.candidate.model_copy(update=place),
        planned_in=world.present,
    )


def next_revision(
    record: MissionRecord, trip: Trip, world: World, *, revision: int, energy_margin: float = 0.0
) -> Mission:
    """The mission with this trip instead of the remainder of its plan; the price stays.

    The drone's own `energy_margin` counts if that is larger than its network's.
    """
    mission = record.mission
    start_at = ms_to_moment(trip.start_ms)
    fresh = {eta.package_id: eta for eta in _etas(trip.plan, start_at)}
    return mission.model_copy(
        update={
            "revision": revision,
            "start_at": start_at,
            "released_at": ms_to_moment(trip.released_ms),
            "packages": tuple(fresh.get(eta.package_id, eta) for eta in mission.packages),
            "plan": trip.plan,
            "home_plan": trip.home_plan,
            "home_recharge": trip.home_recharge,
            "margins": margins_of(world, record.candidate, trip, energy_margin=energy_margin),
            "weather": world.weather_note(trip.start_ms),
            "given_up": None,
        }
    )


def _etas(plan: Plan, start_at: datetime) -> tuple[PackageEta, ...]:
    return tuple(
        PackageEta(
            package_id=delivery.package_id,
            eta_at=start_at + timedelta(seconds=delivery.delivered_s),
        )
        for delivery in plan.deliveries
    )
