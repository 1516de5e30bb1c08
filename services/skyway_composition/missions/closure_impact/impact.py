"""What closures do to live missions: missions that a closure hits need other plans, or come later.

Ground stops are checked again and again, because the next take-off of a mission changes.
"""

import asyncio
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from skyway.drone.model import DroneModel
from skyway.ids import ClosureId, MissionId, NetworkId
from skyway.runtime.sql.database import Database, Tx
from skyway.units import ms_to_moment
from skyway_composition.closures.close import Closings
from skyway_composition.closures.closure import (
    AffectedMission,
    Closure,
    ClosureKind,
    ForeseenDelay,
    Reach,
    WeatherOfModels,
)
from skyway_composition.closures.store import ground_stops
from skyway_composition.context import Context
from skyway_composition.missions.closure_impact import store
from skyway_composition.missions.closure_impact.hits import (
    HeldPad,
    HitMissions,
    Span,
    first_hits,
    flights_of,
    hits_of_flights,
    hits_of_pads,
    hits_of_take_offs,
    hits_of_weather,
    steps_under_way,
)
from skyway_composition.missions.closure_impact.store import Reader
from skyway_composition.missions.mission.record import Trouble
from skyway_composition.missions.mission.store import models_of_missions
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.check_plan import request_plans
from skyway_composition.missions.replanning.foresee import Foresight, rehearsed
from skyway_composition.missions.replanning.outlook import MissionOutlook, Rehearsed
from skyway_composition.missions.replanning.situation import Situation

#: For how many missions a dry run plans; operators see how many more there are. Our own choice.
MOST_PLANNED: Final = 20

#: The id of a closure that is not made.
_SUPPOSED: Final = ClosureId("supposed")


async def situations_of(
    work: MissionUnitOfWork, mission_ids: Collection[MissionId]
) -> list[Situation]:
    """The situations of these missions, as far as they are still under way."""
    records = [each for each in work.missions.values() if each.mission_id in mission_ids]
    return [await Situation.of(work, each) for each in records]


async def delays_of(
    foresight: Foresight, seen: Sequence[Rehearsed], closure: Closure
) -> dict[MissionId, ForeseenDelay]:
    """The delay of each mission; all missions are planned at the same time."""
    supposed = (replace(closure, closure_id=_SUPPOSED),)
    outlooks = await asyncio.gather(*(foresight.outlook(each, supposed=supposed) for each in seen))
    return {
        each.before.record.mission_id: ForeseenDelay(
            plan=found.plan, later_by_s=_later_by_s(found), code=found.code, detail=found.detail
        )
        for each, found in zip(seen, outlooks, strict=True)
    }


def with_delays(
    missions: Iterable[AffectedMission], delays: Mapping[MissionId, ForeseenDelay]
) -> tuple[AffectedMission, ...]:
    """The missions with the delays that are known."""
    return tuple(
        each.model_copy(update={"delay": delays.get(each.mission_id)}) for each in missions
    )


def _later_by_s(outlook: MissionOutlook) -> float | None:
    """How much later the last package is delivered; 0 without a package, None if one is not."""
    arrivals = [(each.eta_at, each.new_eta_at) for each in outlook.packages]
    before = [eta_at for eta_at, _ in arrivals if eta_at is not None]
    after = [new_eta_at for _, new_eta_at in arrivals if new_eta_at is not None]
    if not arrivals:
        return 0.0
    if len(after) < len(arrivals) or not before:
        return None
    return (max(after) - max(before)).total_seconds()


_CODES: Final[Mapping[ClosureKind, str]] = {
    "STATION": "STATION_CLOSED",
    "PAD": "PAD_OUT_OF_ORDER",
    "SEGMENT": "SEGMENT_CLOSED",
    "ZONE": "ZONE_AHEAD",
    "GROUND_STOP": "GROUND_STOP",
}

#: Why missions get new plans when a new forecast closes segments to their drones.
_TOO_MUCH_WIND: Final = Trouble(
    code="WEATHER_AHEAD",
    detail="the forecast has more wind on the way than the limit of the drone model",
)


@dataclass(frozen=True, slots=True)
class MissionImpact:
    """The impact of closures on missions; wakes `stuck` when some need other plans."""

    context: Context
    foresight: Foresight

    async def preview(self, db: Database, reach: Reach) -> tuple[AffectedMission, ...]:
        """The missions that a closure would hit, in the order of their hits."""
        async with db.read() as reader:
            found = await _find_hits(reader, reach, now_ms=self.context.now_ms)
        return found.shown()

    async def foresee(self, db: Database, reach: Reach) -> tuple[AffectedMission, ...]:
        """As `preview`, with the delays of the first `MOST_PLANNED` missions."""
        async with db.read() as reader:
            found = await _find_hits(reader, reach, now_ms=self.context.now_ms)
        first = found.first(MOST_PLANNED)
        if not first.hits:
            return ()
        async with db.rehearse() as tx:
            work = await MissionUnitOfWork.lock(self.context, tx, first.drone_ids)
            before = await situations_of(work, {hit.owner.mission_id for hit in first.hits})
            await _trouble_all(work, reach, first)
            seen = [await rehearsed(work, each) for each in before]
        delays = await delays_of(self.foresight, seen, reach.closure)
        return with_delays(found.shown(), delays)

    async def apply(self, tx: Tx, reach: Reach) -> tuple[AffectedMission, ...]:
        """Request other plans for the missions that a closure hits, and return these missions."""
        found = await _find_hits(tx.connection, reach, now_ms=self.context.now_ms)
        if not found.hits:
            return ()
        work = await MissionUnitOfWork.lock(self.context, tx, found.drone_ids)
        await _trouble_all(work, reach, found)
        tx.after_commit(self.context.stuck.set)
        return found.shown()

    async def retry(self, tx: Tx, network_id: NetworkId | None) -> None:
        """Plan again for missions without a plan or held on the ground; None for all networks."""
        await store.replan_waiting(tx, network_id)
        tx.after_commit(self.context.stuck.set)

    async def models_in_flight(self, db: Database, network_id: NetworkId) -> tuple[DroneModel, ...]:
        """The models of the drones that have missions in a network."""
        async with db.read() as reader:
            models = await models_of_missions(reader, network_id)
        return tuple(dict.fromkeys(models.values()))

    async def apply_weather(self, tx: Tx, network_id: NetworkId, weather: WeatherOfModels) -> int:
        """Request new plans for missions with flights on segments closed by the weather."""
        found = await _closed_by_weather(
            tx.connection, network_id, weather, now_ms=self.context.now_ms
        )
        if not found.hits:
            return 0
        work = await MissionUnitOfWork.lock(self.context, tx, found.drone_ids)
        hit_ids = {hit.owner.mission_id for hit in found.hits}
        records = [each for each in work.missions.values() if each.mission_id in hit_ids]
        await request_plans(work, records, _TOO_MUCH_WIND)
        tx.after_commit(self.context.stuck.set)
        return len(records)


@dataclass(frozen=True, slots=True)
class GroundStopEnforcer:
    """Requests other plans for missions whose next take-off a ground stop now forbids."""

    context: Context
    closings: Closings

    async def step(self) -> bool:
        """Check all ground stops that are in force."""
        async with self.context.db.read() as connection:
            stops = await ground_stops(connection, at_ms=self.context.now_ms)
        for stop in stops:
            await self._enforce(stop)
        return False

    async def _enforce(self, stop: Closure) -> None:
        reach = await self.closings.reach(stop)
        hit = await self.closings.impact.preview(self.context.db, reach)
        async with self.context.db.read() as connection:
            unaware = await store.without_trouble(connection, [each.mission_id for each in hit])
        if unaware:
            async with self.context.db.write() as tx:
                await self.closings.impact.apply(tx, reach)


async def _find_hits(reader: Reader, reach: Reach, *, now_ms: int) -> HitMissions:
    """The live missions that a closure hits after this moment."""
    match reach.closure.kind:
        case "PAD":
            return await _pads(reader, reach, now_ms)
        case "GROUND_STOP":
            return await _hits_on_take_offs(reader, reach, now_ms)
        case _:
            return await _flights(reader, reach, now_ms)


async def _pads(reader: Reader, reach: Reach, now_ms: int) -> HitMissions:
    closure = reach.closure
    if reach.pads_now_with:
        held = await _pads_that_no_longer_fit(reader, reach)
    elif closure.station_id is None or closure.pad is None:
        return HitMissions((), {})
    else:
        held = await store.pads_held(reader, closure.station_id, closure.pad)
    hits = first_hits(hits_of_pads(held, span=Span.of(reach, now_ms=now_ms)))
    return HitMissions(
        hits, await store.activities_of(reader, [hit.owner.drone_id for hit in hits])
    )


async def _pads_that_no_longer_fit(reader: Reader, reach: Reach) -> list[HeldPad]:
    """The reservations of pads whose new connectors do not fit their drones."""
    held = await store.pads_held_at(reader, reach.pads_now_with)
    network_id = reach.closure.network_id
    if not held or network_id is None:
        return []
    models = await models_of_missions(reader, network_id)
    connectors = {mission_id: model.connector for mission_id, model in models.items()}
    return [
        each
        for each in held
        if (connector := connectors.get(each.owner.mission_id)) is not None
        and connector not in reach.pads_now_with[each.station_id]
    ]


async def _flights(reader: Reader, reach: Reach, now_ms: int) -> HitMissions:
    """Hits on landings and flights, of present plans and of proposals."""
    closure, span = reach.closure, Span.of(reach, now_ms=now_ms)
    ends = (reach.stations or frozenset()) | {to_id for _, to_id in reach.segments}
    # Proposals first: a proposal accepted between the two reads is found among the steps.
    proposed = await store.proposals(reader, closure.network_id)
    flights = [
        *(flight for owner, each in proposed for flight in flights_of(owner, each)),
        *await store.flights_to(
            reader, ends, network_id=closure.network_id, start_before_ms=closure.until_ms
        ),
    ]
    perhaps = {hit.owner.drone_id for hit in hits_of_flights(flights, reach, span=span)}
    doing = await store.activities_of(reader, perhaps)
    hits = hits_of_flights(flights, reach, span=span, under_way=steps_under_way(doing))
    return HitMissions(first_hits(hits), doing)


async def _closed_by_weather(
    reader: Reader, network_id: NetworkId, weather: WeatherOfModels, *, now_ms: int
) -> HitMissions:
    """The first flight of each mission on a segment that the weather closes to its drone."""
    proposed = await store.proposals(reader, network_id)
    flights = [
        *(flight for owner, each in proposed for flight in flights_of(owner, each)),
        *await store.flights_of_network(reader, network_id),
    ]
    doing = await store.activities_of(reader, {each.owner.drone_id for each in flights})
    hits = hits_of_weather(
        flights,
        weather,
        await models_of_missions(reader, network_id),
        now_ms=now_ms,
        under_way=steps_under_way(doing),
    )
    return HitMissions(first_hits(hits), doing)


async def _hits_on_take_offs(reader: Reader, reach: Reach, now_ms: int) -> HitMissions:
    stop, span = reach.closure, Span.of(reach, now_ms=now_ms)
    planned = await store.take_offs(
        reader, network_id=stop.network_id, provider_id=stop.provider_id
    )
    doing = await store.activities_of(reader, {flight.owner.drone_id for flight in planned})
    hits = first_hits(
        hits_of_take_offs(planned, reach, span=span, under_way=steps_under_way(doing))
    )
    if stop.drone_model_id is not None:
        meant = await store.drones_of_model(
            reader, [hit.owner.drone_id for hit in hits], stop.drone_model_id
        )
        hits = tuple(hit for hit in hits if hit.owner.drone_id in meant)
    return HitMissions(hits, doing)


async def _trouble_all(work: MissionUnitOfWork, reach: Reach, found: HitMissions) -> None:
    closure = reach.closure
    hit_ids = {hit.owner.mission_id for hit in found.hits}
    # A mission that needs another plan anyway meets the ground stop when it is planned.
    records = [
        record
        for record in work.missions.values()
        if record.mission_id in hit_ids
        if closure.kind != "GROUND_STOP" or record.trouble is None
    ]
    await request_plans(work, records, Trouble(code=_CODES[closure.kind], detail=_detail(reach)))


def _detail(reach: Reach) -> str:
    """What is closed, until when and why, for customers and operators."""
    closure = reach.closure
    what = (
        reach.what
        or {
            "STATION": f"station {closure.station_id!r} is closed",
            "PAD": f"pad {closure.pad} of station {closure.station_id!r} is out of order",
            "SEGMENT": f"the segment {closure.station_id!r} to {closure.to_station_id!r} is closed",
            "ZONE": "a zone is closed to flight",
            "GROUND_STOP": "drones may not take off",
        }[closure.kind]
    )
    since = f" from {ms_to_moment(closure.from_ms).isoformat()}"
    until = (
        "" if closure.until_ms is None else f" until {ms_to_moment(closure.until_ms).isoformat()}"
    )
    why = "" if closure.reason is None else f": {closure.reason}"
    return f"{what}{since}{until}{why}"
