"""From a trip to the steps that a drone can fly alone."""

from collections.abc import Mapping, Sequence
from itertools import zip_longest

from skyway.contracts.flight_step import (
    DeliverStep,
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    WaitStep,
)
from skyway.delivery.plan import Deliver, Fly, PickUp, Recharge, Wait
from skyway.ids import PackageId, StationId
from skyway.network.network import Network, Segment
from skyway.units import ms_to_moment
from skyway_composition.planning.trip import PlacedStep


def flight_steps(
    network: Network,
    placed_steps: Sequence[PlacedStep],
    *,
    masses_kg: Mapping[PackageId, float],
    first_step: int,
) -> tuple[FlightStep, ...]:
    """The steps of a trip with all a drone needs, numbered from `first_step`.

    A FLY lands unless another one follows. A RECHARGE may use the pad for the whole milliseconds
    that are booked: exactly what the plan takes, rounded outward.
    """
    following = placed_steps[1:]
    return tuple(
        _flight_step(network, placed, after, masses_kg=masses_kg, step_id=step_id)
        for step_id, (placed, after) in enumerate(zip_longest(placed_steps, following), first_step)
    )


def wait_there(station_id: StationId, at_ms: int, *, step_id: int) -> WaitStep:
    """A wait that is over at once."""
    at = ms_to_moment(at_ms)
    return WaitStep(
        step_id=step_id,
        planned_start_at=at,
        planned_end_at=at,
        station_id=station_id,
        until_at=at,
    )


def _flight_step(
    network: Network,
    placed: PlacedStep,
    following: PlacedStep | None,
    *,
    masses_kg: Mapping[PackageId, float],
    step_id: int,
) -> FlightStep:
    start_at, end_at = placed.start_at, placed.end_at
    match placed.step:
        case PickUp() as step:
            return PickUpStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                packages=tuple(
                    PackageOnBoard(package_id=package_id, mass_kg=masses_kg[package_id])
                    for package_id in step.package_ids
                ),
            )
        case Fly() as step:
            return FlyStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                from_id=step.from_id,
                to_id=step.to_id,
                from_position=network.stations[step.from_id].position,
                to_position=network.stations[step.to_id].position,
                length_m=_segment(network, step.from_id, step.to_id).length_m,
                lands=following is None or not isinstance(following.step, Fly),
            )
        case Wait() as step:
            return WaitStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                until_at=end_at,
            )
        case Recharge() as step:
            return RechargeStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                pad=step.pad,
                not_before_at=ms_to_moment(placed.start_ms),
                until_soc=step.soc_end,
                not_after_at=ms_to_moment(placed.end_ms),
            )
        case Deliver() as step:
            return DeliverStep(
                step_id=step_id,
                planned_start_at=start_at,
                planned_end_at=end_at,
                station_id=step.station_id,
                package_ids=step.package_ids,
                dropoff_s=step.end_s - step.start_s,
            )


def _segment(network: Network, from_id: StationId, to_id: StationId) -> Segment:
    return next(each for each in network.segments_from(from_id) if each.to_id == to_id)
