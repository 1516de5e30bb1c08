"""The trips that the drones of each model may fly, as the arrays from which a bound is proven."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from skyway.dispatch.estimates import OUT_OF_REACH, Estimates
from skyway.dispatch.objective import J_PER_KWH
from skyway.dispatch.planned_trip import Pool
from skyway.dispatch.problem import FleetProblem
from skyway.drone.flight import flight_power_w
from skyway.drone.model import DroneModel
from skyway.planner.kernels.fleet_bound import Future, Nodes
from skyway.planner.kernels.fleet_trips import NEED
from skyway.planner.kernels.memory import Floats, Longs

#: The width of a bucket of moments, seconds. Our own choice: wider buckets prove less.
_WIDTH_S: Final = 30.0

#: The longest time from the first need to the horizon, seconds: four days.
LONGEST_S: Final = 12_000 * _WIDTH_S


@dataclass(frozen=True, slots=True)
class Start:
    """Where and when a drone begins. Its charge covers the need from `charged_s` to `free_s`."""

    kind: int
    place: int
    free_s: float
    charged_s: float


@dataclass(frozen=True, slots=True)
class Walks:
    """The arrays of one drone model for the kernels."""

    nodes: Nodes
    approach: Floats
    future: Future


def starts_of(problem: FleetProblem, estimates: Estimates, kinds: Sequence[int]) -> list[Start]:
    """Where each drone begins."""
    return [
        Start(
            kind,
            estimates.place_of[drone.station_id],
            drone.free_s,
            drone.free_s - estimates.credit_s(kind, drone.soc),
        )
        for drone, kind in zip(problem.drones, kinds, strict=True)
    ]


def has_short_trips(estimates: Estimates, kinds: Sequence[int], pools: Sequence[Pool]) -> bool:
    """Whether a trip may be shorter than a bucket; then buckets prove nothing."""
    return any(
        estimates.trip_from(source, kind, pool).least[:, NEED].min() < _WIDTH_S
        for kind in set(kinds)
        for pool in pools
        for source in estimates.pickups(pool)
    )


def walks_of(
    problem: FleetProblem,
    estimates: Estimates,
    kind: int,
    pools: Sequence[Pool],
    starts: Sequence[Start],
    sources: Longs,
    horizon_s: float,
) -> Walks:
    """The walks of the drones of one model, up to the horizon or the last bucket."""
    nodes, _ = nodes_of(problem, estimates, kind, pools, sources)
    own = [each for each in starts if each.kind == kind]
    first_s = min(each.charged_s for each in own)
    pace = _least_share_flown(estimates.models[kind], estimates.s_per_j[kind])
    floor = np.array([min(each.free_s - each.charged_s * pace for each in own), pace])
    buckets = math.ceil(max(0.0, horizon_s - first_s) / _WIDTH_S)
    places = len(estimates.places)
    future = Future(
        cost=np.zeros((places, buckets + 1, 2)),
        first=np.full((places, buckets + 1, 2), -1, np.int64),
        trip_cost=np.zeros((len(sources), buckets + 1, 2)),
        trip=np.full((len(sources), buckets + 1, 2), -1, np.int64),
        first_s=first_s,
        width_s=_WIDTH_S,
        floor=floor,
    )
    return Walks(nodes, estimates.approach(kind), future)


def _least_share_flown(model: DroneModel, s_per_j: float) -> float:
    """The least share of a need that is flight or work, not charging."""
    shares = [1.0 / (1.0 + s_per_j * flight_power_w(model, model.max_payload_kg))]
    if model.stop_j > 0:
        shares.append(model.stop_s / (model.stop_s + s_per_j * model.stop_j))
    return min(shares)


def sources_of(problem: FleetProblem, estimates: Estimates) -> Longs:
    """The places where packages are picked up."""
    pickups = dict.fromkeys(at for each in problem.requests for at in (each.source, *each.pickups))
    return np.array([estimates.place_of[each] for each in pickups], np.int64)


def nodes_of(
    problem: FleetProblem,
    estimates: Estimates,
    kind: int,
    pools: Sequence[Pool],
    sources: Longs,
) -> tuple[Nodes, Floats]:
    """The trips of one model; each way of a trip is a node.

    Also what the drone needs at the pickup of each node to reach the next pad, ``(nodes,)``.
    """
    requests, prices = problem.requests, problem.prices
    source_number = {place: number for number, place in enumerate(sources.tolist())}
    most = max(map(len, pools))
    pool_of, source, end, least, member, served, ready = [], [], [], [], [], [], []
    loaded = [
        (number, pool, at) for number, pool in enumerate(pools) for at in estimates.pickups(pool)
    ]
    for number, pool, at in loaded:
        orders = estimates.orders(at, kind, pool)
        for place, costs, by_member, ready_s in zip(
            orders.end.tolist(), orders.least, orders.served, orders.ready_s.tolist(), strict=True
        ):
            if costs.max() >= OUT_OF_REACH:
                continue
            pool_of.append(number)
            source.append(source_number[estimates.place_of[at]])
            end.append(place)
            ready.append(ready_s)
            least.append(costs)
            member.append([*pool, *[-1] * (most - len(pool))])
            served.append(np.pad(by_member, ((0, most - len(pool)), (0, 0))))
    nodes = Nodes(
        pool=np.array(pool_of, np.int64),
        source=np.array(source, np.int64),
        end=np.array(end, np.int64),
        least=np.array(least).reshape(-1, 3),
        member=np.array(member, np.int64).reshape(-1, most),
        served=np.array(served).reshape(-1, most, 2),
        weight=np.array([each.weight for each in requests]),
        known_s=np.array([each.known_s for each in requests]),
        due_s=np.array([math.inf if each.due_s is None else each.due_s for each in requests]),
        price=np.zeros(len(requests)),
        rates=np.array([prices.delivery, prices.lateness, prices.energy_s_per_kwh / J_PER_KWH]),
        hand_over_s=problem.hand_over_s,
    )
    return nodes, np.array(ready)
