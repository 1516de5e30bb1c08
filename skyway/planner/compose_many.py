"""Compose many trips: thousands of exact plans in one compiled call.

Each trip is planned on its own, around the pads that the ledger has reserved. The search and the
proof are the same as those of `compose`. A caller that books trips reserves their sessions in the
ledger and calls again.
"""

from skyway.planner.kernels.handles import handle_of
from skyway.planner.kernels.trips import (
    ALL_DONE,
    LABELS_MADE,
    MEMORY_FULL,
    ROWS_FULL,
    TREES_FULL,
    plan_trips,
)
from skyway.planner.pad_ledger import PadLedger
from skyway.planner.planned_trips import PlannedTrips, new_found, with_room
from skyway.planner.stop import OutOfTime, Stop, never
from skyway.planner.trips import Trips

#: The most labels of the search for one trip. Our own choice: about 0.1 s.
LABELS_PER_TRIP = 1 << 17

#: Labels between two calls of `stop`: about 20 ms.
_LABELS_PER_CALL = 1 << 15


def compose_many(
    trips: Trips,
    ledger: PadLedger,
    *,
    stop: Stop = never,
    labels_per_trip: int = LABELS_PER_TRIP,
) -> PlannedTrips:
    """The earliest plan of each trip, with its proof, as columns.

    Parameters
    ----------
    ledger
        The reserved pads, and the terms that the trips have in common.
    stop
        Ends the work early.
    labels_per_trip
        The most labels for one trip. Then its outcome is the best plan so far, or UNKNOWN.

    Returns
    -------
    PlannedTrips
        A row for each trip; `PlannedTrips.plan` makes the plan of one trip.

    Raises
    ------
    InvalidProblem
        A trip breaks a limit.
    OutOfTime
        The stop ended the work.

    Notes
    -----
    The interpreter's lock is released while the trips are planned.
    """
    trips.check(ledger.terms)
    terms, rows = ledger.terms, handle_of(trips.rows)
    record = new_found(trips)
    found = handle_of(record)
    made = 0
    while True:
        ended = plan_trips(
            terms.skyway,
            terms.closed,
            ledger.held,
            ledger.known,
            ledger.notes,
            terms.rows,
            rows,
            found,
            labels_per_trip,
            _LABELS_PER_CALL,
        )
        if ended == ALL_DONE:
            return PlannedTrips(trips, ledger, record)
        if ended == MEMORY_FULL:
            ledger.enlarge_memory()
        elif ended == TREES_FULL:
            ledger.enlarge_trees()
        elif ended == ROWS_FULL:
            record = with_room(record)
            found = handle_of(record)
        elif ended == LABELS_MADE:
            made += _LABELS_PER_CALL
            if stop(made):
                raise OutOfTime
