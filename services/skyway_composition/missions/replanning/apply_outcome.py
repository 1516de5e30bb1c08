"""What comes of a look for a plan: a revision on its way, another look later, or an end.

Each is kept in a transaction that looks again: meanwhile the mission may have changed.
"""

import logging
from dataclasses import dataclass, replace
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.ids import DroneId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Taken
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Database, Tx
from skyway.units import moment_to_ms
from skyway_composition.links.instruction_store import open_instructions
from skyway_composition.missions.mission.end import abort, cancel
from skyway_composition.missions.mission.instruct import hold
from skyway_composition.missions.mission.notify import raise_alarm
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.case import Case
from skyway_composition.missions.replanning.outlook.situation import Situation
from skyway_composition.missions.replanning.propose import propose, replace_plan
from skyway_composition.missions.replanning.remainder.anchor import Anchor
from skyway_composition.missions.replanning.remainder.planner import Remainder
from skyway_composition.missions.replanning.revision import revision_of
from skyway_composition.missions.replanning.store import put_off, retry_stuck
from skyway_composition.planning.find_trip import NoTrip
from skyway_composition.planning.world import still_holds

log = logging.getLogger(__name__)

#: A mission that needs more revisions than this is going nowhere. Our own choice.
MOST_REVISIONS: Final = 40

#: Wall time until a plan is looked for again when there was none. Our own choice.
_RETRY_MS: Final = 2_000

#: No plan is looked for until somebody wants one at once.
_NEVER_MS: Final = 2**53


@dataclass(frozen=True, slots=True)
class Outcomes:
    """Keeps what came of planning for missions."""

    db: Database
    clock: FleetClock
    mint: Mint

    async def send_or_retry(self, case: Case, anchor: Anchor, remainder: Remainder) -> None:
        """Send this rest of the mission; where a pad is taken by now, look again later."""
        try:
            async with self.db.write() as tx:
                await self._send(tx, case, anchor, remainder)
        except Taken as taken:
            mission_id = case.record.mission_id
            log.info("pad taken", extra={"mission_id": mission_id, "by": taken.constraint})
            await self.retry_later(case.record)

    async def _send(self, tx: Tx, case: Case, anchor: Anchor, remainder: Remainder) -> None:
        """Send this rest of the mission, unless things have changed."""
        # I11: read inside the transaction, and cannot change before it ends.
        holds = await still_holds(tx, case.world)
        work = await self._lock(case.record.drone_id, tx)
        record = work.missions.get(case.record.drone_id)
        is_late = remainder.trip.start_ms < self._now_ms()
        # After the links, as everybody locks them.
        await retry_stuck(tx, case.record.mission_id, at_wall_ms=0)
        if record is None or not holds or is_late or not case.is_unchanged(work, record):
            return
        revision = revision_of(
            record,
            remainder,
            anchor=anchor,
            trouble=case.trouble,
            number=case.sent_revisions + 1,
            energy_margin=case.situation.energy_margin(case.world.skyway.settings),
            skyway=case.world.skyway,
            link=work.links[record.drone_id],
        )
        if case.closed.closes_landing(anchor.station_id, anchor.at_ms) and remainder.given_up:
            await raise_no_landing(work, record, anchor)
        if record.stuck is None:
            await propose(work, record, revision, anchor=anchor, trouble=case.trouble)
        else:
            await replace_plan(work, record, revision, trouble=case.trouble)

    async def retry_later(self, record: MissionRecord) -> None:
        """Look for a plan again a little later."""
        async with self.db.write() as tx:
            await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)

    async def hold(self, record: MissionRecord, stop: str) -> None:
        """Keep the drone on the ground while a ground stop lasts, and look again later."""
        async with self.db.write() as tx:
            work = await self._lock(record.drone_id, tx)
            known = work.missions.get(record.drone_id)
            if known is not None and known.mission_id == record.mission_id:
                await hold_for_stop(work, known, stop=stop)
        await self.retry_later(record)

    async def stop_trying(self, record: MissionRecord, trouble: Trouble) -> None:
        """Make no more plans: who stands gives up, who flies, flies on by the old one."""
        if record.stuck is not None:
            detail = f"{MOST_REVISIONS} revisions led nowhere; the last: {trouble.detail}"
            await self.give_up(record, code=trouble.code, detail=detail)
            return
        async with self.db.write() as tx:
            work = await self._lock(record.drone_id, tx)
            known = work.missions.get(record.drone_id)
            if known is not None and known.mission_id == record.mission_id:
                await stop_trying(work, known, trouble)
                await put_off(tx, record.mission_id, until_wall_ms=_NEVER_MS)

    async def stop_diverting(self, case: Case, reason: NoTrip) -> None:
        """Leave the drone held, since it cannot go where an operator wants it."""
        async with self.db.write() as tx:
            work = await self._lock(case.record.drone_id, tx)
            known = work.missions.get(case.record.drone_id)
            if known is not None and case.is_unchanged(work, known):
                await stop_diverting(work, known, reason=f"{reason.code}: {reason.detail}")
            await put_off(tx, case.record.mission_id, until_wall_ms=self._retry_wall_ms)

    async def give_up(self, planned: MissionRecord, *, code: str, detail: str) -> None:
        """End a mission that was planned for in vain, if it still is the one that was looked at."""
        async with self.db.write() as tx:
            work = await self._lock(planned.drone_id, tx)
            record = work.missions.get(planned.drone_id)
            if record is None or record.mission_id != planned.mission_id:
                return
            if record.stuck is None and work.links[record.drone_id].is_gone:
                # It may begin without having heard: it is asked again, or silent for too long.
                await put_off(tx, record.mission_id, until_wall_ms=self._retry_wall_ms)
                return
            await give_up(work, record, code=code, detail=detail)

    async def _lock(self, drone_id: DroneId, tx: Tx) -> MissionUnitOfWork:
        return await MissionUnitOfWork.lock([drone_id], tx=tx, clock=self.clock, mint=self.mint)

    @property
    def _retry_wall_ms(self) -> int:
        return moment_to_ms(self.clock.wall_now()) + _RETRY_MS

    def _now_ms(self) -> int:
        return moment_to_ms(self.clock.now())


async def give_up(
    work: MissionUnitOfWork, record: MissionRecord, *, code: str, detail: str
) -> None:
    """End a mission whose drone stands, where it stands."""
    if record.stuck is not None:
        await abort(work, record, at=work.clock.now(), code=code, detail=detail)
    else:
        await cancel(work, record, code=code, detail=detail)


def refusal_code(situation: Situation, trouble: Trouble, *, code: str) -> str:
    """Why nothing is flown: the packages weigh otherwise than planned, or the planner's word."""
    planned = {
        package.package_id: package.mass_kg
        for step in situation.planned
        if isinstance(step, PickUpStep)
        for package in step.packages
    }
    loaded = {each.package_id: each.mass_kg for each in trouble.loaded or ()}
    return "MASS_MISMATCH" if loaded and loaded != planned else code


async def hold_for_stop(work: MissionUnitOfWork, record: MissionRecord, *, stop: str) -> None:
    """Keep a drone on the ground while a ground stop lasts; its next revision ends the hold."""
    state = work.links[record.drone_id].state
    if state is not None and state.is_held and state.mission_id == record.mission_id:
        return
    sent = await open_instructions(work.tx, record.drone_id)
    if any(each.kind == "HOLD" for each in sent):
        return
    await hold(work, record, reason=stop)


async def raise_no_landing(work: MissionUnitOfWork, record: MissionRecord, anchor: Anchor) -> None:
    """Tell operators of a drone that lands where nobody should, since it can reach nothing else."""
    await raise_alarm(
        work,
        record,
        level="CRITICAL",
        code="NO_SAFE_LANDING",
        detail=f"no open station is in reach; the drone lands at {anchor.station_id!r}",
        station_id=anchor.station_id,
        data={"soc": anchor.soc},
    )


async def stop_trying(work: MissionUnitOfWork, record: MissionRecord, trouble: Trouble) -> None:
    """Let a drone that refuses every revision fly on by its plan, and tell operators.

    The trouble stays: without it the same would be found, and told, every second.
    """
    await raise_alarm(
        work,
        record,
        level="URGENT",
        code="REVISIONS_REFUSED",
        detail=f"no revision was taken; the drone flies on in spite of {trouble.code}",
    )


async def stop_diverting(work: MissionUnitOfWork, record: MissionRecord, *, reason: str) -> None:
    """Leave a drone held where it stands or lands next, since it cannot go where it was sent."""
    await raise_alarm(
        work,
        record,
        level="URGENT",
        code="DIVERSION_IMPOSSIBLE",
        detail=f"the drone is held where it stands or lands next; {reason}",
    )
    await work.save(replace(record, trouble=None))
