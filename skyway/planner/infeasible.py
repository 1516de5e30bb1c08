"""Cheap proofs that no plan exists; without such a proof the status is unknown."""

import math

from skyway.delivery.plan import Infeasibility
from skyway.planner.in_range import is_out_of_range
from skyway.planner.matrix import TimeMatrix
from skyway.planner.problem import Problem
from skyway.planner.situation import Situation
from skyway.planner.stop import Effort, LabelLimit, Stop, first_of
from skyway.planner.subnetwork import Subnetwork
from skyway.units import LOAD_TOLERANCE_KG, TIME_TOLERANCE_S

#: Labels after which the proof of OUT_OF_RANGE is given up. Our own choice: about 1 s.
_MAX_LABELS = 50_000


def overweight(problem: Problem) -> Infeasibility | None:
    """OVERWEIGHT if the drone cannot lift all packages together."""
    mass_kg = math.fsum(package.mass_kg for package in problem.packages)
    model = problem.drone.model
    if mass_kg <= model.max_payload_kg + LOAD_TOLERANCE_KG:
        return None
    return Infeasibility(
        code="OVERWEIGHT",
        detail=f"payload {mass_kg:g} kg exceeds the {model.max_payload_kg:g} kg limit of drone "
        f"model {model.model_id}",
    )


def proof_of_infeasibility(situation: Situation, stop: Stop) -> Infeasibility | None:
    """Why no plan exists, if a search without pad times or a lower bound shows it."""
    whole = Subnetwork.whole(situation)
    unreachable = _unreachable(situation, whole)
    if unreachable is not None:
        return unreachable
    lower_bound_s = TimeMatrix(situation, whole, approach=whole).lower_bound_s()
    if lower_bound_s == math.inf:
        detail = "no order of the destinations has a path through all of them"
        return Infeasibility(code="DESTINATION_UNREACHABLE", detail=detail)
    effort = Effort(first_of(stop, LabelLimit(_MAX_LABELS)))
    if is_out_of_range(situation, whole, effort):
        return Infeasibility(
            code="OUT_OF_RANGE",
            detail="even with every pad free and every recharge to the top of the charge curve "
            f"the {situation.model.model_id} cannot fly to all destinations in turn",
        )
    latest_s = situation.problem.latest_delivery_s
    if latest_s is not None and lower_bound_s > latest_s + TIME_TOLERANCE_S:
        return Infeasibility(
            code="TOO_LATE",
            detail=f"no plan is over before {lower_bound_s:.3f} s, even with every pad free; "
            f"latest_delivery_s is {latest_s:g}",
        )
    return None


def _unreachable(situation: Situation, whole: Subnetwork) -> Infeasibility | None:
    """DESTINATION_UNREACHABLE for the first place to which no path leads, or that is closed."""
    problem = situation.problem
    flights = [(problem.source, station_id) for station_id in situation.destinations]
    if problem.start_station_id != problem.source:
        flights.insert(0, (problem.start_station_id, problem.source))
    for start, end in flights:
        detail = None
        if situation.closures.is_closed_for_good(end):
            detail = f"station {end!r} is closed for good"
        elif start not in whole.lengths_to_m(end):
            detail = f"no path leads from {start!r} to {end!r}"
        if detail is not None:
            return Infeasibility(code="DESTINATION_UNREACHABLE", detail=detail)
    return None
