"""What a closure does to the missions that are under way: they look for other plans."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from skyway.runtime.clock import FleetClock
from skyway.runtime.loops import Wake
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.closures.closure import AffectedMission, ClosureKind, Reach
from skyway_composition.missions.affected import store
from skyway_composition.missions.affected.find import Found, find_hits
from skyway_composition.missions.record import Trouble
from skyway_composition.missions.trouble import troubled_all
from skyway_composition.missions.watch import Watch

_CODES: Final[Mapping[ClosureKind, str]] = {
    "STATION": "STATION_CLOSED",
    "PAD": "PAD_OUT_OF_ORDER",
    "SEGMENT": "SEGMENT_CLOSED",
    "ZONE": "ZONE_AHEAD",
    "GROUND_STOP": "GROUND_STOP",
}


@dataclass(frozen=True, slots=True)
class MissionImpact:
    """`closures.impact.Impact` on missions; `stuck` is woken when some need other plans."""

    clock: FleetClock
    mint: Mint
    stuck: Wake

    async def preview(self, db: Database, reach: Reach) -> tuple[AffectedMission, ...]:
        """The missions that it would hit, the first to be hit first."""
        async with db.read() as reader:
            found = await find_hits(reader, reach, now_ms=self._now_ms)
        return found.shown()

    async def apply(self, tx: Tx, reach: Reach) -> tuple[AffectedMission, ...]:
        """The missions that it hits; they look for other plans from now on."""
        found = await find_hits(tx.connection, reach, now_ms=self._now_ms)
        if not found.hits:
            return ()
        watch = await Watch.over(found.drone_ids, tx=tx, clock=self.clock, mint=self.mint)
        await _trouble_all(watch, reach, found)
        tx.after_commit(self.stuck.set)
        return found.shown()

    async def retry(self, tx: Tx, reach: Reach) -> None:
        """Have those that found no plan, or were held on the ground, look again."""
        await store.look_again(tx, reach.closure.network_id)
        tx.after_commit(self.stuck.set)

    @property
    def _now_ms(self) -> int:
        return moment_to_ms(self.clock.now())


async def _trouble_all(watch: Watch, reach: Reach, found: Found) -> None:
    closure = reach.closure
    hit_ids = {hit.owner.mission_id for hit in found.hits}
    # Whoever looks for another plan anyway finds a ground stop by itself.
    records = [
        record
        for record in watch.missions.values()
        if record.mission_id in hit_ids
        if closure.kind != "GROUND_STOP" or record.trouble is None
    ]
    await troubled_all(watch, records, Trouble(code=_CODES[closure.kind], detail=_detail(reach)))


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
