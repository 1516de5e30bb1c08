"""The fleet plan: the trips of each drone, their costs, and the proven lower bound of the costs."""

from typing import Annotated, Literal

from pydantic import Field

from skyway.delivery.plan import Plan
from skyway.dispatch.objective import Costs
from skyway.dispatch.problem import FleetProblem
from skyway.dispatch.schedule import Schedule
from skyway.ids import DroneId
from skyway.json_model import JsonModel


class ServedRequest(JsonModel):
    """When the last package of a request is delivered, in seconds of the problem."""

    request_id: str
    delivered_s: float


class FleetTrip(JsonModel):
    """One trip: its requests share it. The moments of `plan` count from `start_s`."""

    drone_id: DroneId
    start_s: float
    requests: tuple[ServedRequest, ...]
    plan: Plan


class UnservedRequest(JsonModel):
    """A request without a trip, and why."""

    request_id: str
    code: str
    detail: str


class FleetCosts(JsonModel):
    """The objective and its parts; docs/dispatch.md gives the formula."""

    total_s: Annotated[float, Field(description="The objective.")]
    mean_delivery_s: Annotated[
        float | None,
        Field(description="Mean time from the arrival of a request to its last delivery."),
    ]
    lateness_s: Annotated[float, Field(description="Sum of lateness, by weight.")]
    energy_j: float
    moves: int
    served: int

    @classmethod
    def of(cls, problem: FleetProblem, costs: Costs) -> "FleetCosts":
        """These costs in the form for people and JSON."""
        served = costs.delivered_s
        waited_s = [moment_s - problem.requests[one].known_s for one, moment_s in served.items()]
        return cls(
            total_s=costs.total_s,
            mean_delivery_s=sum(waited_s) / len(served) if served else None,
            lateness_s=costs.lateness_s,
            energy_j=costs.energy_j,
            moves=costs.moves,
            served=len(served),
        )


class FleetPlan(JsonModel):
    """Trips, ordered by drone and start. `arrival_order` is the cost of first come, first served.

    `lower_bound_s`: no plan of the problem has a lower objective. `gap` is the difference between
    the objective and this bound, as a share of the objective, 0 to 1. Both are null if no bound was
    requested. `is_best_order`: it is proven that no order in which the trips are planned, each as
    early as it can be, has a lower objective.
    """

    costs: FleetCosts
    arrival_order: FleetCosts
    lower_bound_s: float | None = None
    gap: float | None = None
    is_best_order: bool = False
    trips: tuple[FleetTrip, ...]
    unserved: tuple[UnservedRequest, ...]
    method: Literal["arrival order", "search"]
    rounds: Annotated[int, Field(description="Orders that the exact planner planned completely.")]

    @classmethod
    def of(
        cls,
        problem: FleetProblem,
        schedule: Schedule,
        *,
        arrival: Schedule,
        rounds: int,
        is_best_order: bool,
        lower_bound_s: float | None = None,
    ) -> "FleetPlan":
        """The plan of this schedule, whose trips were planned and are not held any more."""
        total_s = schedule.costs.total_s
        gap = None
        if lower_bound_s is not None:
            lower_bound_s = min(lower_bound_s, total_s)
            gap = 1.0 - lower_bound_s / total_s if total_s > 0 else 0.0
        return cls(
            costs=FleetCosts.of(problem, schedule.costs),
            arrival_order=FleetCosts.of(problem, arrival.costs),
            lower_bound_s=lower_bound_s,
            gap=gap,
            is_best_order=is_best_order,
            trips=_trips(problem, schedule),
            unserved=tuple(
                UnservedRequest(
                    request_id=problem.requests[number].request_id,
                    code=reason.code,
                    detail=reason.detail,
                )
                for number, reason in sorted(schedule.unserved.items())
            ),
            method="arrival order" if schedule is arrival else "search",
            rounds=rounds,
        )


def _trips(problem: FleetProblem, schedule: Schedule) -> tuple[FleetTrip, ...]:
    by_start = sorted(schedule.trips, key=lambda each: (each.drone, each.trip.slot.at_ms))
    return tuple(
        FleetTrip(
            drone_id=problem.drones[drone].drone_id,
            start_s=trip.slot.at_ms / 1000,
            requests=tuple(
                ServedRequest(
                    request_id=problem.requests[number].request_id, delivered_s=moment_ms / 1000
                )
                for number, moment_ms in zip(trip.pool, trip.delivered_ms, strict=True)
            ),
            plan=trip.plan(problem.requests),
        )
        for drone, trip in by_start
    )
