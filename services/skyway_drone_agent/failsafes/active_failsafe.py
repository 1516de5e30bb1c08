"""What a drone does by itself just now, as the cloud is told."""

from skyway.contracts.drone_health import ActiveFailsafe, Failsafe
from skyway.contracts.flight_step import FlyStep
from skyway.ids import StationId
from skyway_drone_agent.failsafes.failsafe import is_severer, severest, situation_of
from skyway_drone_agent.journal.logbook import Logbook
from skyway_drone_agent.journal.step_places import end_of


def active_failsafe(logbook: Logbook) -> ActiveFailsafe | None:
    """The failsafe that acts, and where it leads; None while the drone does as it was told."""
    mission = logbook.mission
    if mission is None:
        return None
    if mission.escape is not None:
        fault, failsafe = mission.escape.fault, mission.escape.failsafe
    else:
        faults = [fault for fault in logbook.faults if fault not in mission.ignored_faults]
        acting = severest(situation_of(logbook), faults)
        if acting is None or not is_severer(acting[1], Failsafe.WARN):
            return None
        fault, failsafe = acting
    station_id = None if failsafe is Failsafe.LAND_NOW else _next_stand(logbook)
    return ActiveFailsafe(fault=fault, failsafe=failsafe, station_id=station_id)


def _next_stand(logbook: Logbook) -> StationId | None:
    """Where the drone stands, or lands next."""
    if logbook.station_id is not None or logbook.mission is None:
        return logbook.station_id
    flights = (step for step in logbook.mission.steps if isinstance(step, FlyStep) and step.lands)
    return next((end_of(step) for step in flights), None)
