"""The missions that a closure hits, and what their drones do now."""

from collections.abc import Mapping
from dataclasses import dataclass

from skyway.ids import DroneId
from skyway.units import ms_to_moment
from skyway_composition.closures.closure import AffectedMission, Reach
from skyway_composition.missions.affected import store
from skyway_composition.missions.affected.hits import (
    Hit,
    Span,
    first_hits,
    hits_of_flights,
    hits_of_pads,
    hits_of_take_offs,
    steps_under_way,
)
from skyway_composition.missions.affected.planned import Doing, flights_of
from skyway_composition.missions.affected.store import Reader


@dataclass(frozen=True, slots=True)
class Found:
    """The first hit of each mission, the earliest first, and what the drones of them do."""

    hits: tuple[Hit, ...]
    doing: Mapping[DroneId, Doing]

    @property
    def drone_ids(self) -> list[DroneId]:
        """The drones of the missions that are hit."""
        return [hit.owner.drone_id for hit in self.hits]

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


async def find_hits(reader: Reader, reach: Reach, *, now_ms: int) -> Found:
    """The live missions that a closure hits after this moment."""
    match reach.closure.kind:
        case "PAD":
            return await _pads(reader, reach, now_ms)
        case "GROUND_STOP":
            return await _take_offs(reader, reach, now_ms)
        case _:
            return await _flights(reader, reach, now_ms)


async def _pads(reader: Reader, reach: Reach, now_ms: int) -> Found:
    closure = reach.closure
    if closure.station_id is None or closure.pad is None:
        return Found((), {})
    held = await store.pads_held(reader, closure.station_id, closure.pad)
    hits = first_hits(hits_of_pads(held, span=Span.of(reach, now_ms=now_ms)))
    return Found(hits, await store.doings_of(reader, [hit.owner.drone_id for hit in hits]))


async def _flights(reader: Reader, reach: Reach, now_ms: int) -> Found:
    """Landings and flights, of the plans that hold and of those that were proposed."""
    closure, span = reach.closure, Span.of(reach, now_ms=now_ms)
    ends = (reach.stations or frozenset()) | {to_id for _, to_id in reach.segments}
    # Proposals first: one that is accepted between the two reads is among the steps then.
    proposed = await store.proposals(reader, closure.network_id)
    flights = [
        *(flight for owner, each in proposed for flight in flights_of(owner, each)),
        *await store.flights_to(
            reader, ends, network_id=closure.network_id, start_before_ms=closure.until_ms
        ),
    ]
    perhaps = {hit.owner.drone_id for hit in hits_of_flights(flights, reach, span=span)}
    doing = await store.doings_of(reader, perhaps)
    hits = hits_of_flights(flights, reach, span=span, under_way=steps_under_way(doing))
    return Found(first_hits(hits), doing)


async def _take_offs(reader: Reader, reach: Reach, now_ms: int) -> Found:
    stop, span = reach.closure, Span.of(reach, now_ms=now_ms)
    planned = await store.take_offs(
        reader, network_id=stop.network_id, provider_id=stop.provider_id
    )
    doing = await store.doings_of(reader, {flight.owner.drone_id for flight in planned})
    hits = first_hits(
        hits_of_take_offs(planned, reach, span=span, under_way=steps_under_way(doing))
    )
    if stop.drone_model_id is not None:
        meant = await store.drones_of_model(
            reader, [hit.owner.drone_id for hit in hits], stop.drone_model_id
        )
        hits = tuple(hit for hit in hits if hit.owner.drone_id in meant)
    return Found(hits, doing)
