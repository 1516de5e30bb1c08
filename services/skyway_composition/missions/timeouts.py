"""Checks missions because time has passed: overdue missions, late missions, and awaited loadings.

No clock ends a mission whose drone may have the packages. Such a mission is put in doubt, and
waits for its drone or for an operator.

What proves that a drone does not fly a booking, and has not flown it? The best proof is the drone's
own report: it names another mission, or none, and we have read all of its events. Silence is a
proof only to a process that has listened all the time.
"""

import logging
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from typing import Final

from skyway.contracts.flight_step import PickUpStep
from skyway.ids import DroneId, NetworkId
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition import alarm_store
from skyway_composition.context import Context
from skyway_composition.links.link import DroneLink
from skyway_composition.links.listening import Listening
from skyway_composition.margins import (
    ACK_ARRIVES,
    ANSWER_IS_DOUBTED,
    REPORT_ARRIVES,
    SILENCE_IS_DOUBTED,
    Margin,
)
from skyway_composition.missions.interventions.confirm_loading import LoadingFault, refuse_loading
from skyway_composition.missions.mission.end import abort, put_in_doubt, refuse
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.store import models_of_missions
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork
from skyway_composition.missions.replanning.check_plan import check_plan
from skyway_composition.missions.timeout_store import (
    UNKNOWN_AFTER_MS,
    UNKNOWN_CODE,
    AwaitedLoading,
    awaited_loadings,
    perhaps_late,
    perhaps_overdue,
    unknown_missions,
)
from skyway_composition.planning.world import ClosedAhead, World

log = logging.getLogger(__name__)

#: The least wall time, in seconds, that a loader has. On a fast clock a program confirms, and its
#: request and our answer may take longer than half an hour of fleet time. Our own choice.
_LEAST_WALL_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class OverdueMissions:
    """Judges overdue missions of own drones: only the owner of a drone has listened to it."""

    context: Context
    listening: Listening

    async def step(self) -> bool:
        """Judge the missions of this replica's drones that are overdue now."""
        self.listening.look()
        now = self.context.clock.now()
        longest_wait = SILENCE_IS_DOUBTED.span(self.context.clock)
        async with self.context.db.read() as connection:
            drone_ids = await perhaps_overdue(
                connection,
                expired_ms=moment_to_ms(now),
                released_ms=moment_to_ms(now - longest_wait),
            )
        for drone_id in filter(self.listening.owns, drone_ids):
            await self._judge(drone_id, silent_since=now - longest_wait)
        return False

    async def _judge(self, drone_id: DroneId, *, silent_since: datetime) -> None:
        async with self.context.db.write() as tx:
            work = await MissionUnitOfWork.lock(self.context, tx, [drone_id])
            record, link = work.missions.get(drone_id), work.links.get(drone_id)
            if record is None or link is None:
                return
            if link.has_unread_events:
                # The events decide. A drone that does not send them keeps its mission.
                work.links[drone_id] = link = await work.courier.ask_for_events(tx, link)
            is_long_over = record.mission.released_at < silent_since
            if record.mission.state == "BOOKED":
                await self._judge_booking(work, record, link)
            elif is_long_over and record.stuck is not None and not link.has_unread_events:
                detail = f"no plan for the remainder was found: {record.stuck.detail}"
                why = Trouble(code=record.stuck.code, detail=detail)
                await abort(work, record, why, at=self.context.clock.now())
            elif is_long_over and _is_silent(record, link, since=silent_since):
                detail = "the drone has sent no message about the mission since its planned end"
                await put_in_doubt(work, record, code="SILENT", detail=detail)

    async def _judge_booking(
        self, work: MissionUnitOfWork, record: MissionRecord, link: DroneLink
    ) -> None:
        """Refuse an expired booking that is surely not flown; doubt it when no answer comes."""
        now, expired_at = self.context.clock.now(), ms_to_moment(record.expires_ms)
        if now <= expired_at:
            return
        ack_due_at = now - ACK_ARRIVES.span(self.context.clock)
        sent_at = expired_at - work.courier.lifetime
        has_listened = self.listening.covers(record.drone_id, sent_at, ack_due_at)
        detail = f"the drone did not answer until {expired_at.isoformat()}"
        if _says_not_flown(record, link) or _silence_proves_not_flown(
            record, link, ack_due_at=ack_due_at, has_listened=has_listened
        ):
            await refuse(work, record, Trouble(code="NO_ANSWER", detail=detail))
        elif now > expired_at + ANSWER_IS_DOUBTED.span(self.context.clock):
            await put_in_doubt(work, record, code="NO_ANSWER", detail=detail)


def _is_silent(record: MissionRecord, link: DroneLink, *, since: datetime) -> bool:
    """Whether the drone has not reported since this moment that it flies this mission."""
    state = link.state
    return state is None or state.at < since or state.mission_id != record.mission_id


def _says_not_flown(record: MissionRecord, link: DroneLink) -> bool:
    """Whether the drone has said since the expiry that it does not fly the booking.

    A drone that stands idle may have flown the whole mission while this process was away. Then its
    state names events that were not read here.
    """
    state, doubt = link.state, record.mission.doubt
    if state is None or moment_to_ms(state.at) <= record.expires_ms:
        return False
    if state.mission_id == record.mission_id or link.has_unread_events:
        return False
    return doubt is None or doubt.code != "JOURNAL_LOST"


def _silence_proves_not_flown(
    record: MissionRecord, link: DroneLink, *, ack_due_at: datetime, has_listened: bool
) -> bool:
    """Whether a disconnected drone would have answered by now if it had accepted the booking.

    A drone loads only if the broker had its answer before the instruction expired. `has_listened`:
    this process has received and handled everything since the booking was sent.
    """
    has_lost_journal = record.mission.doubt is not None and record.mission.doubt.code == (
        "JOURNAL_LOST"
    )
    has_expired = moment_to_ms(ack_due_at) > record.expires_ms
    return link.is_gone and has_expired and has_listened and not has_lost_journal


@dataclass(slots=True)
class UnknownMissions:
    """Raises an alarm while missions are flown that the gateway does not know; then ends it."""

    context: Context
    #: From when on it looks: after a stop the first reports are old, and that is no fault. Wall ms.
    _from_ms: int = 0
    #: Whether there were such missions at the last look; None before the first look.
    _were_found: bool | None = None

    async def step(self) -> bool:
        """Raise or end the alarm; always False. Once acknowledged, it is not raised again."""
        wall_ms, at_ms = moment_to_ms(self.context.clock.wall_now()), self.context.now_ms
        self._from_ms = self._from_ms or wall_ms + UNKNOWN_AFTER_MS
        if wall_ms < self._from_ms:
            return False
        async with self.context.db.read() as connection:
            found = await unknown_missions(connection, wall_ms=wall_ms)
        if bool(found) == self._were_found:
            return False
        async with self.context.db.write() as tx:
            if not found:
                await alarm_store.end(tx, {UNKNOWN_CODE}, about=(None, None), at_ms=at_ms)
            elif not await alarm_store.is_open(tx.connection, None, code=UNKNOWN_CODE):
                oldest_s = (wall_ms - min(found.values())) / 1000
                detail = f"{len(found)} missions, the first for {oldest_s:.0f} s: none of their "
                detail += "reports has reached the gateway, so customers do not know of them"
                about = partial(alarm_store.add, tx, level="CRITICAL", code=UNKNOWN_CODE)
                await about(detail=detail, at_ms=at_ms, mint=self.context.mint)
        self._were_found = bool(found)
        return False


@dataclass(frozen=True, slots=True)
class LateMissions:
    """Checks missions with an overdue step; wakes `stuck` when one needs another plan.

    A late drone may not report that it is late. A plan avoids closures that begin later, but a
    drone that comes later than planned may meet them. Its plan is checked before it loses its pads.
    """

    context: Context

    async def step(self) -> bool:
        """Check the missions that are late now."""
        async with self.context.db.read() as connection:
            # The report about a step that has just ended may still be on its way.
            ended_at = self.context.clock.now() - REPORT_ARRIVES.span(self.context.clock)
            late = await perhaps_late(connection, ended_ms=moment_to_ms(ended_at))
        for network_id, drone_ids in late.items():
            closed = await self._closed(network_id)
            for drone_id in drone_ids:
                await self._judge(drone_id, closed)
        return False

    async def _closed(self, network_id: NetworkId) -> ClosedAhead:
        now_ms = self.context.now_ms
        skyway = await self.context.networks.current(network_id)
        world = await World.of(skyway, self.context.db, after_ms=now_ms)
        if world.weather_note(now_ms) is not None:
            # Read here, so that nothing is computed while a mission is locked.
            async with self.context.db.read() as connection:
                models = await models_of_missions(connection, network_id)
            for model in {*models.values()}:
                await world.weather(model, now_ms)
        return ClosedAhead.of(world, now_ms=now_ms)

    async def _judge(self, drone_id: DroneId, closed: ClosedAhead) -> None:
        async with self.context.db.write() as tx:
            work = await MissionUnitOfWork.lock(self.context, tx, [drone_id])
            record = work.missions.get(drone_id)
            if record is not None and (await check_plan(work, record, closed)).needs_plan:
                tx.after_commit(self.context.stuck.set)


@dataclass(frozen=True, slots=True)
class LoadingTimeouts:
    """Ends missions that were not loaded in time."""

    context: Context

    async def step(self) -> bool:
        """End the missions that have waited too long."""
        now_ms = self.context.now_ms
        async with self.context.db.read() as connection:
            awaited = await awaited_loadings(connection, started_before_ms=now_ms)
        for each in awaited:
            skyway = await self.context.networks.current(each.network_id)
            timeout_s = skyway.settings.loading_timeout_s
            timeout = Margin(timeout_s, _LEAST_WALL_S).span(self.context.clock)
            # A drone that has started later than this cannot have waited that long.
            if each.start_ms <= moment_to_ms(self.context.clock.now() - timeout):
                await self._judge(each, timeout)
        return False

    async def _judge(self, awaited: AwaitedLoading, timeout: timedelta) -> None:
        async with self.context.db.write() as tx:
            work = await MissionUnitOfWork.lock(self.context, tx, [awaited.drone_id])
            record = work.missions.get(awaited.drone_id)
            if record is None or record.mission_id != awaited.mission_id:
                return
            since = await _loading_since(work, record)
            if since is None or self.context.clock.now() < since + timeout:
                return
            detail = f"no loader has confirmed since {since.isoformat()}"
            fault = LoadingFault("LOADING_TIMEOUT", detail, {"timeout_s": timeout.total_seconds()})
            await refuse_loading(work, record, fault)


async def _loading_since(work: MissionUnitOfWork, record: MissionRecord) -> datetime | None:
    """Since when the drone waits for a loader; None while it does not wait for one.

    A drone that has not begun, is held by an operator, or waits for a plan does not wait for a
    loader.
    """
    mission = record.mission
    is_awaited = (mission.state, mission.loading) == ("ACTIVE", "AWAITED")
    if not is_awaited or record.is_being_loaded or mission.is_held or record.stuck is not None:
        return None
    since = record.mission.start_at
    for each in await work.steps.of(record.mission_id):
        if each.status == "ENDED" and each.event is not None:
            since = max(since, each.event.ended_at)
        elif isinstance(each.step, PickUpStep):
            return max(since, each.step.planned_start_at)
        else:
            return None
    return None
