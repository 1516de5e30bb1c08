"""The legs of the mission, worked out once for each of its plans."""

from skyway.contracts.flight_step import FlyStep
from skyway.drone.model import DroneModel
from skyway_drone_agent.analysis.leg import Leg, leg_of, legs_ahead
from skyway_drone_agent.journal.logbook import Logbook


class KnownLegs:
    """Remembers the leg under way and those ahead until the logbook says otherwise."""

    __slots__ = ("_ahead", "_leg", "_load_kg", "_model", "_seen")

    def __init__(self, model: DroneModel) -> None:
        self._model = model
        self._leg: Leg | None = None
        self._load_kg = 0.0
        self._ahead: tuple[Leg, ...] = ()
        self._seen: tuple[object, object] = (None, None)

    def leg(self, step: FlyStep, *, load_kg: float) -> Leg:
        """The leg under way; the same object as long as it is the same step."""
        leg = self._leg
        if leg is None or leg.step is not step or self._load_kg != load_kg:
            leg = self._leg = leg_of(step, model=self._model, load_kg=load_kg)
            self._load_kg = load_kg
        return leg

    def ahead(self, logbook: Logbook) -> tuple[Leg, ...]:
        """The next flights up to a recharge among them."""
        mission = logbook.mission
        seen = (mission.steps if mission else None, logbook.packages)
        if seen[0] is not self._seen[0] or seen[1] is not self._seen[1]:
            self._seen = seen
            self._ahead = (
                legs_ahead(mission, packages=logbook.packages, model=self._model) if mission else ()
            )
        return self._ahead

    def released(self, logbook: Logbook, leg: Leg | None) -> tuple[Leg, ...]:
        """The leg under way, or the next one over a station, and all up to the next landing."""
        mission = logbook.mission
        if leg is None and (mission is None or logbook.station_id is not None):
            return ()
        flights: list[Leg] = []
        for flight in self.ahead(logbook):
            if leg is not None and not flights and flight.step is not leg.step:
                # Away from the plan: it ends where this flight ends.
                break
            flights.append(flight)
            if flight.step.lands:
                break
        return tuple(flights) if flights else (leg,) if leg else ()
