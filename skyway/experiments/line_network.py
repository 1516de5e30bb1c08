"""A plan's own route as a network of its own: a line on which only amounts and pads are open."""

from collections import defaultdict

from skyway.delivery.plan import Deliver, Fly, Plan
from skyway.ids import StationId
from skyway.network.network import Network, Segment, Station
from skyway.planner.problem import PackageToDeliver, PadReservation, Problem


def line_problem(problem: Problem, plan: Plan) -> Problem:
    """The same delivery with the route fixed to that of this plan.

    Every visit of a station is a station of its own, with the pads and reservations of the
    original; the only segments lead from each visit to the next.
    """
    visits = [problem.start_station_id]
    handed_over_at: dict[StationId, int] = {}
    segments = []
    for step in plan.steps:
        if isinstance(step, Fly):
            visits.append(step.to_id)
            segments.append(_segment(problem.network, step, number=len(visits) - 1))
        elif isinstance(step, Deliver):
            handed_over_at[step.station_id] = len(visits) - 1
    stations = [
        _visit(problem.network.stations[original], number) for number, original in enumerate(visits)
    ]
    network = Network({station.station_id: station for station in stations}, tuple(segments))
    return problem.model_copy(
        update={
            "network": network,
            "source": _visit_id(visits.index(problem.source)),
            "drone": problem.drone.model_copy(update={"station_id": _visit_id(0)}),
            "packages": tuple(
                _package(package, handed_over_at[package.destination])
                for package in problem.packages
            ),
            "pad_reservations": _reservations(problem, visits),
        }
    )


def _visit_id(number: int) -> StationId:
    return StationId(f"visit-{number}")


def _visit(original: Station, number: int) -> Station:
    return Station(_visit_id(number), original.position, original.pads)


def _segment(network: Network, step: Fly, *, number: int) -> Segment:
    """The segment to the visit of this number."""
    length_m = next(
        segment.length_m
        for segment in network.segments_from(step.from_id)
        if segment.to_id == step.to_id
    )
    return Segment(_visit_id(number - 1), _visit_id(number), length_m)


def _package(package: PackageToDeliver, visit: int) -> PackageToDeliver:
    return package.model_copy(update={"destination": _visit_id(visit)})


def _reservations(problem: Problem, visits: list[StationId]) -> tuple[PadReservation, ...]:
    numbers: dict[StationId, list[int]] = defaultdict(list)
    for number, original in enumerate(visits):
        numbers[original].append(number)
    return tuple(
        reservation.model_copy(update={"station_id": _visit_id(number)})
        for reservation in problem.pad_reservations
        for number in numbers[reservation.station_id]
    )
