"""What one search over the fleets of three providers brings, against a search of each fleet.

A request goes to the drone that delivers it first, of any provider, as a booking does. Then
each provider's trips are searched alone, or the trips of all providers together: all deliveries may
change their provider, or every other one. Three drones of each provider have 36 requests within an
hour, as many for each drone as in the larger cases.
"""

from collections.abc import Iterator
from statistics import mean
from typing import Final

from skyway_lab.benchmarks.planner.table import Table
from skyway_lab.experiments.dispatched_hour.cases import fleet_case
from skyway_lab.experiments.dispatched_hour.policies import DispatchPolicy, searched_in_rounds
from skyway_lab.experiments.dispatched_hour.rolling import RollingHour
from skyway_lab.experiments.fleet_hour.cases import Load, Place

from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule, Scheduler
from skyway.planner.problem_parts import PadReservation

_PROVIDERS: Final = 3
_LOAD: Final = Load(9, 36)
_PLACES: Final[tuple[Place, ...]] = ("city", "corridor")

_TOGETHER: Final = searched_in_rounds(5, most_steps=8_000)


def providers(*, seeds: int) -> Iterator[Table]:
    """Mean minutes from each request to its last delivery, with promises and without."""
    table = Table(
        "providers",
        f"{_PROVIDERS} providers, {_LOAD} in all",
        ("case", "promises", "each fleet alone", "half may change", "all fleets together"),
    )
    for place in _PLACES:
        for name, tolerance_s in (("none", None), ("10 min wide, firm after 10 min", 600.0)):
            row = []
            for plan in (_each_alone, _half_together, _TOGETHER):
                policy = DispatchPolicy(
                    name, plan, promise_tolerance_s=tolerance_s, firm_within_s=600.0
                )
                row.append(_cell(place, policy, seeds))
            table.rows.append((place, name, *row))
    yield table


def _cell(place: Place, policy: DispatchPolicy, seeds: int) -> str:
    hours = [
        RollingHour(fleet_case(place, _LOAD, seed=seed), policy, seed)
        for seed in range(1, seeds + 1)
    ]
    for hour in hours:
        hour.run()
    means = [hour.mean_min for hour in hours]
    return f"{mean(means):.0f} ({', '.join(f'{each:.0f}' for each in means)})"


def _half_together(problem: FleetProblem, seed: int) -> Schedule:
    """One search in which requests with odd numbers stay with the provider that has them.

    A new request is at first with the provider whose drone delivers it first.
    """
    scheduler = Scheduler(problem)
    booked = scheduler.current() or scheduler.arrival_order()
    size = len(problem.drones) // _PROVIDERS
    drones = [
        each.model_copy(update={"provider_id": f"provider-{number // size}"})
        for number, each in enumerate(problem.drones)
    ]
    requests = [*problem.requests]
    for each in booked.trips:
        for number in each.trip.pool:
            if int(requests[number].request_id) % 2:
                own = {"provider_ids": (drones[each.drone].provider_id,)}
                requests[number] = requests[number].model_copy(update=own)
    changes = {"drones": tuple(drones), "requests": tuple(requests)}
    return _TOGETHER(problem.model_copy(update=changes), seed)


def _each_alone(problem: FleetProblem, seed: int) -> Schedule:
    """The current plan with new requests behind it, and a search of each provider's trips.

    The drones of a provider follow one another in the problem. A search is for the pads that all
    other fleets leave free. Its order counts if the plan of all trips then costs less, and no
    promise is broken that the plan before keeps.
    """
    scheduler = Scheduler(problem)
    best = scheduler.current() or scheduler.arrival_order()
    size = len(problem.drones) // _PROVIDERS
    for first in range(0, len(problem.drones), size):
        own = range(first, first + size)
        numbers = [one for each in best.trips if each.drone in own for one in each.trip.pool]
        if not numbers:
            continue
        held = tuple(
            PadReservation(
                station_id=pad.station_id,
                pad=pad.pad,
                start_s=pad.start_ms / 1000,
                end_s=pad.end_ms / 1000,
            )
            for each in best.trips
            if each.drone not in own
            for pad in each.trip.pads
        )
        alone = problem.model_copy(
            update={
                "drones": problem.drones[first : first + size],
                "requests": tuple(problem.requests[each] for each in numbers),
                "pad_reservations": (*problem.pad_reservations, *held),
            }
        )
        sequences = list(best.sequences(len(problem.drones)))
        for number, trips in enumerate(_TOGETHER(alone, seed).sequences(size), first):
            sequences[number] = tuple(tuple(numbers[one] for one in pool) for pool in trips)
        found = scheduler.planned(tuple(sequences))
        if found.costs.total_s < best.costs.total_s and _keeps(problem, found, best):
            best = found
    return best


def _keeps(problem: FleetProblem, found: Schedule, before: Schedule) -> bool:
    """Whether each request comes by its promise, or no later than before."""
    return all(
        found.costs.delivered_s.get(number, 0.0)
        <= max(each.promised_s, before.costs.delivered_s.get(number, 0.0))
        for number, each in enumerate(problem.requests)
        if each.promised_s is not None
    )
