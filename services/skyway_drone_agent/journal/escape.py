"""Escapes: the flights with which failsafes replace the flight under way, and their end."""

from datetime import datetime, timedelta
from typing import Protocol

from skyway.contracts.drone_health import Failsafe
from skyway.contracts.flight_step import FlyStep
from skyway.drone.flight import flight_time_s
from skyway.drone.model import DroneModel
from skyway.geo import Position, distance_m
from skyway.ids import StationId
from skyway_drone_agent.journal.current_mission import CurrentMission, Escape, FlownBefore
from skyway_drone_agent.journal.records import FailsafeBegun, FailsafeOverridden

#: Metres of a flight that ends where it begins; a flight has a length above 0.
_ON_THE_SPOT_M = 0.001


class Place(Protocol):
    """A station and where it is."""

    @property
    def station_id(self) -> StationId:
        """The station's id."""
        ...

    @property
    def position(self) -> Position:
        """The station's position."""
        ...


def flight_to(
    landing: Place,
    *,
    instead_of: FlyStep,
    here: Position,
    at: datetime,
    model: DroneModel,
    load_kg: float,
) -> FlyStep:
    """The flight straight from here to a landing."""
    length_m = max(distance_m(here, landing.position), _ON_THE_SPOT_M)
    flight_s = flight_time_s(model, length_m=length_m, load_kg=load_kg) + model.stop_s
    return instead_of.model_copy(
        update={
            "planned_start_at": at,
            "planned_end_at": at + timedelta(seconds=flight_s),
            "to_id": landing.station_id,
            "from_position": here,
            "to_position": landing.position,
            "length_m": length_m,
            "lands": True,
        }
    )


def descent(*, instead_of: FlyStep, here: Position, at: datetime, model: DroneModel) -> FlyStep:
    """A flight straight down; its station ids have no meaning."""
    return instead_of.model_copy(
        update={
            "planned_start_at": at,
            "planned_end_at": at + timedelta(seconds=model.stop_s),
            "from_position": here,
            "to_position": here,
            "length_m": _ON_THE_SPOT_M,
            "lands": True,
        }
    )


def flight_resumed(escape: Escape, *, here: Position) -> FlyStep:
    """The flight that was planned before the escape, from here."""
    planned = escape.instead_of
    length_m = max(distance_m(here, planned.to_position), _ON_THE_SPOT_M)
    return planned.model_copy(update={"from_position": here, "length_m": length_m})


def mission_escaping(mission: CurrentMission, begun: FailsafeBegun) -> CurrentMission:
    """The mission after a failsafe turned its flight; no later step stays released."""
    instead_of = mission.escape.instead_of if mission.escape else mission.steps[0]
    if not isinstance(instead_of, FlyStep):
        return mission
    turned = _turned(mission, begun.flight, at=begun.at, used_j=begun.used_j)
    escape = Escape(fault=begun.fault, failsafe=begun.failsafe, instead_of=instead_of)
    return turned.model_copy(
        update={"escape": escape, "released_through": begun.flight.step_id, "changed_at": None}
    )


def mission_overridden(mission: CurrentMission, overridden: FailsafeOverridden) -> CurrentMission:
    """The mission once people have overridden its failsafe."""
    ignored = tuple(dict.fromkeys((*mission.ignored_faults, *overridden.faults)))
    mission = mission.model_copy(update={"ignored_faults": ignored})
    if mission.escape is None or overridden.flight is None:
        return mission
    resumed = _turned(mission, overridden.flight, at=overridden.at, used_j=overridden.used_j)
    landing = next(step for step in resumed.steps if isinstance(step, FlyStep) and step.lands)
    return resumed.model_copy(update={"escape": None, "released_through": landing.step_id})


def lands_on_the_spot(mission: CurrentMission) -> bool:
    """Whether the flight under way goes straight down."""
    return mission.escape is not None and mission.escape.failsafe is Failsafe.LAND_NOW


def _turned(
    mission: CurrentMission, flight: FlyStep, *, at: datetime, used_j: float
) -> CurrentMission:
    """The mission with this flight instead of the one under way."""
    before = mission.flown_before or FlownBefore(since=mission.began_at or at, used_j=0.0)
    flown_before = before.model_copy(update={"used_j": before.used_j + used_j})
    steps = (flight, *mission.steps[1:])
    return mission.model_copy(update={"steps": steps, "began_at": at, "flown_before": flown_before})
