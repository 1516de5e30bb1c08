"""Where and when a closure meets what live missions still have to do."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

from skyway.contracts.flight_step import FlyStep
from skyway.drone.model import DroneModel
from skyway.ids import DeliveryId, DroneId, MissionId, ProviderId, StationId
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.closure import AffectedMission, Reach, WeatherOfModels
from skyway_composition.missions.mission.record import Proposal


@dataclass(frozen=True, slots=True)
class Owner:
    """A live mission with its drone, provider and delivery."""

    mission_id: MissionId
    drone_id: DroneId
    provider_id: ProviderId
    delivery_id: DeliveryId


@dataclass(frozen=True, slots=True)
class PlannedFlight:
    """A planned flight of a mission that has not ended, with its planned times."""

    owner: Owner
    step_id: int
    from_id: StationId
    to_id: StationId
    lands: bool
    start_ms: int
    end_ms: int


@dataclass(frozen=True, slots=True)
class HeldPad:
    """A pad that a mission has reserved."""

    owner: Owner
    station_id: StationId
    start_ms: int
    end_ms: int


@dataclass(frozen=True, slots=True)
class DroneActivity:
    """The last reported activity of a drone."""

    mission_id: MissionId | None
    step_id: int | None
    is_flying: bool


def flights_of(owner: Owner, proposal: Proposal) -> Iterator[PlannedFlight]:
    """The flights of a revision that the drone has not accepted yet."""
    for step in proposal.steps:
        if isinstance(step, FlyStep):
            yield PlannedFlight(
                owner,
                step.step_id,
                step.from_id,
                step.to_id,
                step.lands,
                moment_to_ms(step.planned_start_at),
                moment_to_ms(step.planned_end_at),
            )


@dataclass(frozen=True, slots=True)
class Hit:
    """The first step of a mission that a closure makes impossible."""

    owner: Owner
    station_id: StationId
    at_ms: int


@dataclass(frozen=True, slots=True)
class HitMissions:
    """The first hit of each mission, the earliest first, and the activities of their drones."""

    hits: tuple[Hit, ...]
    doing: Mapping[DroneId, DroneActivity]

    @property
    def drone_ids(self) -> list[DroneId]:
        """The drones of the missions that are hit."""
        return [hit.owner.drone_id for hit in self.hits]

    def first(self, limit: int) -> "HitMissions":
        """The first of these missions."""
        return HitMissions(self.hits[:limit], self.doing)

    def shown(self) -> tuple[AffectedMission, ...]:
        """The missions as operators see them."""
        return tuple(
            AffectedMission(
                mission_id=hit.owner.mission_id,
                drone_id=hit.owner.drone_id,
                provider_id=hit.owner.provider_id,
                delivery_id=hit.owner.delivery_id,
                station_id=hit.station_id,
                at=ms_to_moment(hit.at_ms),
                is_flying=hit.owner.drone_id in self.doing
                and self.doing[hit.owner.drone_id].is_flying,
            )
            for hit in self.hits
        )


@dataclass(frozen=True, slots=True)
class Span:
    """When something is closed, and what may still happen in that time.

    A drone may be `late_ms` late without another plan. An overdue step is still to come.
    """

    from_ms: float
    until_ms: float
    now_ms: int
    late_ms: int

    @classmethod
    def of(cls, reach: Reach, *, now_ms: int) -> "Span":
        """The time span of a closure as seen now."""
        closure = reach.closure
        until_ms = math.inf if closure.until_ms is None else closure.until_ms
        return cls(closure.from_ms, until_ms, now_ms, reach.late_ms)

    def meets(self, start_ms: int, end_ms: int) -> bool:
        """Whether something planned for this time may happen while it is closed."""
        return start_ms < self.until_ms and max(end_ms, self.now_ms) + self.late_ms >= self.from_ms


def hits_of_flights(
    flights: Iterable[PlannedFlight],
    reach: Reach,
    *,
    span: Span,
    under_way: Collection[tuple[MissionId, int]] = (),
) -> Iterator[Hit]:
    """The landings at stations of `reach`, and the flights on its segments.

    A flight under way cannot leave its segment, but its landing can still be changed.
    """
    stations = reach.stations or frozenset()
    for flight in flights:
        is_begun = (flight.owner.mission_id, flight.step_id) in under_way
        lands_there = flight.lands and flight.to_id in stations
        if lands_there and span.meets(flight.end_ms, flight.end_ms):
            yield Hit(flight.owner, flight.to_id, flight.end_ms)
        elif (
            (flight.from_id, flight.to_id) in reach.segments
            and not is_begun
            and span.meets(flight.start_ms, flight.end_ms)
        ):
            yield Hit(flight.owner, flight.to_id, flight.start_ms)


def hits_of_pads(held: Iterable[HeldPad], *, span: Span) -> Iterator[Hit]:
    """The sessions on a pad that is out of order."""
    for each in held:
        if each.start_ms < span.until_ms and each.end_ms > max(span.from_ms, span.now_ms):
            yield Hit(each.owner, each.station_id, each.start_ms)


def hits_of_take_offs(
    take_offs: Iterable[PlannedFlight],
    reach: Reach,
    *,
    span: Span,
    under_way: Collection[tuple[MissionId, int]],
) -> Iterator[Hit]:
    """The next take-off of each mission, where a ground stop forbids it."""
    following: dict[MissionId, PlannedFlight] = {}
    for flight in sorted(take_offs, key=lambda each: each.step_id):
        if (flight.owner.mission_id, flight.step_id) not in under_way:
            following.setdefault(flight.owner.mission_id, flight)
    for flight in following.values():
        is_meant = reach.stations is None or flight.from_id in reach.stations
        if is_meant and span.meets(flight.start_ms, flight.start_ms):
            yield Hit(flight.owner, flight.from_id, flight.start_ms)


def hits_of_weather(
    flights: Iterable[PlannedFlight],
    weather: WeatherOfModels,
    models: Mapping[MissionId, DroneModel],
    *,
    now_ms: int,
    under_way: Collection[tuple[MissionId, int]],
) -> Iterator[Hit]:
    """The flights on segments that the weather closes to drones of the mission's model.

    A flight under way cannot leave its segment.
    """
    for flight in flights:
        model = models.get(flight.owner.mission_id)
        is_begun = (flight.owner.mission_id, flight.step_id) in under_way
        if model is None or is_begun or not weather.of_model(model).closes_some:
            continue
        # An overdue flight is still to come.
        start_s, end_s = (max(each, now_ms) / 1000 for each in (flight.start_ms, flight.end_ms))
        if weather.of_model(model).closes(
            flight.from_id, flight.to_id, start_s=start_s, end_s=end_s
        ):
            yield Hit(flight.owner, flight.to_id, flight.start_ms)


def first_hits(hits: Iterable[Hit]) -> tuple[Hit, ...]:
    """One hit of each mission, the earliest; the earliest missions first."""
    by_mission: dict[MissionId, Hit] = {}
    for hit in sorted(hits, key=lambda each: (each.at_ms, each.owner.mission_id)):
        by_mission.setdefault(hit.owner.mission_id, hit)
    return tuple(by_mission.values())


def steps_under_way(doing: Mapping[DroneId, DroneActivity]) -> set[tuple[MissionId, int]]:
    """The flights that drones report as under way, as pairs of mission and step."""
    return {
        (each.mission_id, each.step_id)
        for each in doing.values()
        if each.is_flying and each.mission_id is not None and each.step_id is not None
    }
