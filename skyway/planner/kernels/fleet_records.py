"""The input of the dispatcher's kernels: estimates of trips, and the prices of requests.

A *pool* is a set of requests that may share a trip; its number counts from 0. A *place* is a
station where a drone is free, or where packages are picked up or handed over. A *kind* is a drone
model. The *need* of a flight is its time plus the time to charge its energy at the fastest rate of
the charge curve.
"""

from typing import NamedTuple

from skyway.planner.kernels.memory import Floats, Longs


class FleetEstimates(NamedTuple):
    """Estimates of all trips, as if every pad were free.

    - By drone: `kind`, `start` place, `free_s`, and `credit_s`, the need that its charge covers.
    - `approach` ``(kinds, places, places, 3)``: seconds, need and joules of the empty flight.
    - By kind and pool: `flight` ``(kinds, pools, 3)`` seconds, need and joules from the pickup to
      the end of the last hand-over; `end` place; `early_s` ``(kinds, pools, members)``, how long
      before the end of the trip each member is served, in the order of least need;
      `soonest` ``(kinds, pools, members, 2)``, seconds and need from the pickup to the moment
      before which no order serves the member.
    - By pool: `source` place, and `members` ``(pools, members)``, requests in rising order, -1 for
      none. `key` is made of the members (`key_of`), rising, and `pool_of_key` its pool.
    - By request: `weight`; `known_s`; `ready_s`, the earliest loading; `due_s` and `latest_s` (inf
      without a limit); `planned`, its drone in the current plan or -1.
    - By drone `provider`, and by provider `least_flown`, the least requests that it has to fly.
    - `prices`: delivery, lateness, joule, move, each second after `latest_s`, and each request that
      a provider has to fly and does not fly.
    - `hand_over_s` is between two trips of a drone.
    """

    kind: Longs
    start: Longs
    free_s: Floats
    credit_s: Floats
    approach: Floats
    flight: Floats
    end: Longs
    early_s: Floats
    soonest: Floats
    source: Longs
    members: Longs
    key: Longs
    pool_of_key: Longs
    weight: Floats
    known_s: Floats
    ready_s: Floats
    due_s: Floats
    latest_s: Floats
    planned: Longs
    provider: Longs
    least_flown: Longs
    prices: Floats
    hand_over_s: float


class Rows(NamedTuple):
    """The trips of all drones.

    `pool` ``(drones, most)`` are the trips in order; `length` and `cost` are by drone.
    """

    pool: Longs
    length: Longs
    cost: Floats
