"""The costs of the trips of drones, by their estimates, and the number of a shared trip."""

import numpy as np

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.fleet_records import FleetEstimates
from skyway.planner.kernels.memory import Longs, int64

#: Bits of one request in a key: at most 2,000 requests, and 4 members.
KEY_BITS = 11


@kernel
def key_of(members: Longs) -> int:
    """One number for a set of requests in rising order."""
    key = int64(0)
    for member in members:
        if member >= 0:
            key = (key << KEY_BITS) | (member + 1)
    return key


@kernel
def pool_of(fleet: FleetEstimates, members: Longs) -> int:
    """The number of the pool of these requests, -1 if they may not share a trip."""
    key = key_of(members)
    place = np.searchsorted(fleet.key, key)
    if place < fleet.key.size and fleet.key[place] == key:
        return fleet.pool_of_key[place]
    return int64(-1)


@kernel
def cost_of_trip(
    fleet: FleetEstimates, drone: int, pool: int, flown_s: float, charged_s: float
) -> float:
    """The cost of the requests of a trip, without energy.

    `flown_s` and `charged_s` are when loading can begin, by the flights and by the needs so far.
    """
    kind, prices = fleet.kind[drone], fleet.prices
    end_s = max(flown_s + fleet.flight[kind, pool, 0], charged_s + fleet.flight[kind, pool, 1])
    cost = 0.0
    for number in range(fleet.members.shape[1]):
        request = fleet.members[pool, number]
        if request < 0:
            break
        served_s = end_s - fleet.early_s[kind, pool, number]
        cost += fleet.weight[request] * (
            prices[0] * (served_s - fleet.known_s[request])
            + prices[1] * max(0.0, served_s - fleet.due_s[request])
        )
        # The exact planner looks for an order of the stops that is never too late.
        soonest = fleet.soonest[kind, pool, number]
        soonest_s = max(flown_s + soonest[0], charged_s + soonest[1])
        cost += prices[4] * max(0.0, soonest_s - fleet.latest_s[request])
        if fleet.planned[request] >= 0 and fleet.planned[request] != drone:
            cost += prices[3]
    return cost


@kernel
def cost_of_row(fleet: FleetEstimates, drone: int, row: Longs, length: int) -> float:
    """The cost of the trips of one drone, by their estimates."""
    kind = fleet.kind[drone]
    place = fleet.start[drone]
    flown_s = fleet.free_s[drone]
    charged_s = fleet.free_s[drone] - fleet.credit_s[drone]
    cost = 0.0
    for number in range(length):
        pool = row[number]
        source = fleet.source[pool]
        flown_s += fleet.approach[kind, place, source, 0]
        for member in fleet.members[pool]:
            if member >= 0:
                flown_s = max(flown_s, fleet.ready_s[member])
        charged_s += fleet.approach[kind, place, source, 1]
        cost += fleet.prices[2] * (
            fleet.approach[kind, place, source, 2] + fleet.flight[kind, pool, 2]
        )
        cost += cost_of_trip(fleet, drone, pool, flown_s, charged_s)
        flown_s += fleet.flight[kind, pool, 0] + fleet.hand_over_s
        charged_s += fleet.flight[kind, pool, 1] + fleet.hand_over_s
        place = fleet.end[kind, pool]
    return cost


@kernel
def requests_in(fleet: FleetEstimates, row: Longs, length: int) -> int:
    """The number of requests that the trips of a row serve."""
    count = int64(0)
    for number in range(length):
        for member in fleet.members[row[number]]:
            count += member >= 0
    return count


@kernel
def shortage_cost(fleet: FleetEstimates, flown: Longs) -> float:
    """The cost of requests that providers have to fly for fairness and do not fly."""
    missing = int64(0)
    for provider in range(flown.size):
        missing += max(int64(0), fleet.least_flown[provider] - flown[provider])
    return fleet.prices[5] * missing
