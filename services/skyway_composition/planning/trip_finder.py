"""Finds the trips of one round: each distinct one is composed once."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from skyway.contracts.candidate import Candidate
from skyway.delivery.request import DeliveryRequest
from skyway_composition.pads.booked_pad import BookedPad
from skyway_composition.planning.problem_for import Standing, delivery_problem
from skyway_composition.planning.round_trip import NoTrip, round_trip
from skyway_composition.planning.solver_pool import SolverPool
from skyway_composition.planning.trip import Trip
from skyway_composition.planning.world import World


@dataclass(slots=True)
class TripFinder:
    """Composes in one world for one start; what it has found it knows.

    The last delivery lies at `latest_ms` at most, None: whenever.
    """

    solver: SolverPool
    world: World
    start_ms: int
    latest_ms: int | None
    _found: dict[object, Trip | NoTrip] = field(default_factory=dict)

    async def trip(
        self, candidate: Candidate, request: DeliveryRequest, *, held: Sequence[BookedPad] = ()
    ) -> Trip | NoTrip:
        """The trip of this candidate with the packages of a request; `held` pads count as taken."""
        key = (
            candidate.model,
            candidate.station_id,
            candidate.soc,
            candidate.home_station_id,
            request.packages,
            tuple(held),
        )
        found = self._found.get(key)
        if found is None:
            found = self._found[key] = await self._composed(candidate, request, held)
        return found

    async def _composed(
        self, candidate: Candidate, request: DeliveryRequest, held: Sequence[BookedPad]
    ) -> Trip | NoTrip:
        latest_ms = self.latest_ms
        if latest_ms is not None and latest_ms < self.start_ms:
            detail = "the deadline lies before the earliest start"
            return self._with_deadline(NoTrip("TOO_LATE", detail, is_temporary=False))
        problem = delivery_problem(
            self.world,
            Standing(candidate.model, candidate.soc, candidate.station_id),
            pickup=request.pickup.station_id,
            packages=request.packages,
            start_ms=self.start_ms,
            latest_ms=latest_ms,
            held=held,
        )
        trip = await round_trip(
            self.solver,
            self.world,
            problem,
            home_station_id=candidate.home_station_id,
            held=held,
        )
        if isinstance(trip, NoTrip) and trip.code in ("TOO_LATE", "NO_PAD_IN_TIME"):
            return self._with_deadline(trip)
        return trip

    def _with_deadline(self, reason: NoTrip) -> NoTrip:
        if self.latest_ms is None:
            return reason
        return replace(reason, data=(("latest_s", (self.latest_ms - self.start_ms) / 1000),))
