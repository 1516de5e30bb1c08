"""A unit of work on some drones: their links and live missions, locked in one transaction.

Its changes are reported to the gateway and the registry, and alarms go to operators and providers.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Final, Self

from skyway.contracts.drone_report import AlarmLevel
from skyway.contracts.mission import Mission
from skyway.contracts.mission_reports import MISSION_REPORTS, FreeFrom, MissionReport
from skyway.ids import DeliveryId, DroneId, InstructionId, MissionId, ProviderId, StationId
from skyway.runtime.clock import FleetClock
from skyway.runtime.errors import Conflict, NotFound
from skyway.runtime.minting import Mint
from skyway.runtime.outbox.outbox_store import confirm
from skyway.runtime.sql.database import Tx
from skyway.runtime.tracing import in_trace_of
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition import alarm_store
from skyway_composition.calendar.commit import Snapshot, WorldChanged, lock_as_seen
from skyway_composition.calendar.store import raise_versions
from skyway_composition.context import Context
from skyway_composition.links.courier import Courier, Draft
from skyway_composition.links.link import DroneLink
from skyway_composition.links.store import lock_links, save_last_links
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.custody_store import LiveCustody
from skyway_composition.missions.mission.record import MissionRecord, moved
from skyway_composition.missions.mission.share import Share
from skyway_composition.missions.mission.share_views import own_fields, serves
from skyway_composition.missions.mission.step_store import LiveSteps

#: The reports that say when a drone is busy or free. So do all about a QUEUED mission, which may
#: move to another drone. The registry needs no others.
_OF_THE_DRONE: Final = ("ACCEPTED", "REFUSED", "ENDED")


@dataclass(slots=True)
class MissionUnitOfWork:
    """The locked links and live missions of some drones, and their changes.

    Every transaction locks links before missions. Changes are saved one by one (`save`), or staged
    and saved together at the end (`stage`, `save_staged`).
    """

    tx: Tx
    clock: FleetClock
    mint: Mint
    links: dict[DroneId, DroneLink]
    missions: dict[DroneId, MissionRecord]
    #: The steps of the locked missions, and who holds their packages.
    steps: LiveSteps = field(init=False)
    custody: LiveCustody = field(init=False)
    _staged_links: set[DroneId] = field(default_factory=set)
    _staged_missions: set[DroneId] = field(default_factory=set)
    _staged_calendars: set[DroneId] = field(default_factory=set)
    #: The drones whose calendars have a new number already.
    _raised: set[DroneId] = field(default_factory=set)
    _answered: list[InstructionId] = field(default_factory=list)
    #: The alarms that each mission's state kept open when it was read or saved last.
    _alarming: dict[MissionId, frozenset[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        live = self.missions.values()
        self.steps = LiveSteps(self.tx, [each.mission_id for each in live])
        self.custody = LiveCustody(self.tx, [one for each in live for one in each.delivery_ids])
        self._alarming |= {each.mission_id: _alarming(each) for each in self.missions.values()}

    @classmethod
    async def lock(cls, context: Context, tx: Tx, drone_ids: Collection[DroneId]) -> Self:
        """Lock these drones; a drone that has never sent anything has no link."""
        links = await lock_links(tx, drone_ids)
        return cls(tx, context.clock, context.mint, links, await store.lock_live(tx, drone_ids))

    @classmethod
    async def lock_as_seen(cls, context: Context, tx: Tx, seen: Snapshot) -> Self:
        """Lock the network and the drones of a snapshot.

        Raises
        ------
        WorldChanged
            Something that was planned with has changed since.
        """
        links = await lock_as_seen(tx, seen)
        return cls(
            tx, context.clock, context.mint, links, await store.lock_live(tx, seen.calendars)
        )

    @property
    def courier(self) -> Courier:
        """The sender of instructions to these drones."""
        return Courier(self.clock, self.mint, self._traceparent)

    def _traceparent(self, drone_id: DroneId) -> str | None:
        record = self.missions.get(drone_id)
        return None if record is None else record.traceparent

    async def send(
        self, drone_id: DroneId, draft: Draft, *, expires_at: datetime | None = None
    ) -> InstructionId:
        """Send an instruction to a locked drone; returns the instruction's id."""
        link, instruction_id = await self.courier.post(
            self.tx, self.links[drone_id], draft, expires_at=expires_at
        )
        self.links[drone_id] = link
        return instruction_id

    def stage_link(self, link: DroneLink) -> None:
        """Stage a changed link; `save_staged` saves it."""
        before = self.links[link.drone_id]
        if link != before:
            self.links[link.drone_id] = link
            self._staged_links.add(link.drone_id)
        if link.is_occupied != before.is_occupied:
            self._staged_calendars.add(link.drone_id)

    def stage(self, record: MissionRecord) -> None:
        """Stage a changed live mission; `save_staged` saves it."""
        if self.missions[record.drone_id].in_calendar != record.in_calendar:
            self._staged_calendars.add(record.drone_id)
        self.missions[record.drone_id] = record
        self._staged_missions.add(record.drone_id)

    def stage_answer(self, instruction_id: InstructionId) -> None:
        """Stage that an instruction was answered; `save_staged` stops its repetition."""
        self._answered.append(instruction_id)

    async def save_staged(self) -> None:
        """Save all staged changes at the end of a transaction, for any number of messages."""
        changed = self._staged_calendars - self._raised
        await self.change_calendars(changed - self._staged_links)
        links = [self.links[each] for each in sorted(self._staged_links)]
        save_last_links(self.tx, links, changed_calendars=changed)
        staged = [self.missions[each] for each in sorted(self._staged_missions)]
        store.save_last(self.tx, staged, next_ends_ms=await self.steps.next_ends_ms())
        for record in staged:
            await self._end_alarms(record)
        await confirm(self.tx, self._answered)
        self._staged_links.clear()
        self._staged_calendars.clear()
        self._staged_missions.clear()
        self._answered.clear()

    async def save(self, record: MissionRecord) -> None:
        """Save a changed mission; an ended mission leaves the unit of work.

        A QUEUED mission is saved too. It is not the drone's live mission.
        """
        live = self.missions.get(record.drone_id)
        if record.is_live:
            self._staged_missions.discard(record.drone_id)
            self.missions[record.drone_id] = record
        elif live is not None and live.mission_id == record.mission_id:
            self._staged_missions.discard(record.drone_id)
            del self.missions[record.drone_id]
        await store.save_all(self.tx, [record])
        await self.change_calendars([record.drone_id])
        await self._end_alarms(record)

    async def plan_queue_again(self, drone_id: DroneId) -> None:
        """Have the QUEUED missions of a drone planned again, because one has left its calendar."""
        await store.plan_queue_again(self.tx, drone_id)
        await self.change_calendars([drone_id])

    async def change_calendars(self, drone_ids: Collection[DroneId]) -> None:
        """Note that these drones have other calendars after this transaction."""
        await raise_versions(self.tx, sorted({*drone_ids} - self._raised))
        self._raised.update(drone_ids)

    async def _end_alarms(self, record: MissionRecord) -> None:
        """End the alarms that the mission's state no longer keeps open."""
        before, now = self._alarming.get(record.mission_id, frozenset()), _alarming(record)
        self._alarming[record.mission_id] = now
        if over := before - now:
            at_ms, about = moment_to_ms(self.clock.now()), (record.drone_id, record.mission_id)
            await alarm_store.end(self.tx, over, about=about, at_ms=at_ms)


def _alarming(record: MissionRecord) -> frozenset[str]:
    """The codes of alarms that the mission's state keeps open."""
    of_doubt = record.is_live and record.mission.doubt is not None
    of_trouble = record.is_live and record.trouble is not None
    return (alarm_store.OF_DOUBT if of_doubt else frozenset()) | (
        alarm_store.OF_TROUBLE if of_trouble else frozenset()
    )


async def lock_mission(
    context: Context, tx: Tx, mission_id: MissionId, *, provider_id: ProviderId | None
) -> tuple[MissionUnitOfWork, MissionRecord]:
    """A live mission of this provider (None: of any), locked together with its drone's link.

    Raises
    ------
    NotFound
        There is no such mission of this provider.
    Conflict
        MISSION_OVER: it has ended. MISSION_QUEUED: it was not sent to its drone yet.
    """
    # The first read, without a lock, finds the drone: its link is locked before the mission.
    found = await store.get(tx.connection, mission_id, provider_id=provider_id)
    if found is None:
        raise NotFound("mission", mission_id)
    work = await MissionUnitOfWork.lock(context, tx, [found.drone_id])
    record = work.missions.get(found.drone_id)
    if found.mission.state == "QUEUED":
        detail = f"{mission_id} waits for the missions before it, and was not sent to its drone yet"
        raise Conflict("MISSION_QUEUED", detail)
    if record is None or record.mission_id != mission_id:
        raise Conflict("MISSION_OVER", f"{mission_id} is over")
    return work, record


def report(
    work: MissionUnitOfWork,
    record: MissionRecord,
    kind: str,
    *,
    at: datetime | None = None,
    **fields: Any,  # the members of MissionReport that this kind carries, checked by the model
) -> MissionRecord:
    """Report a change of a mission, which happened now if not `at`; the caller saves the record.

    Reports of one mission are numbered, and arrive in order.
    """
    return report_in(work.tx, work.mint, record, kind, at=at or work.clock.now(), **fields)


def report_in(
    tx: Tx,
    mint: Mint,
    record: MissionRecord,
    kind: str,
    *,
    at: datetime,
    kinds: Mapping[MissionId, str] | None = None,
    **fields: Any,  # as for `report`
) -> MissionRecord:
    """Report as `report` does, in a transaction that has locked the mission or adds it.

    Each delivery of a shared mission gets a report of its own, with its own packages. `kinds` has
    the kind for each of them, if the kinds differ.
    """
    if not record.shares:
        seq = record.report_seq + 1
        sent = _sent(mint, record, record.mission, kind, seq, {"at": at, **fields})
        _send(tx, record, sent, traceparent=record.traceparent)
        return replace(record, report_seq=seq)
    shares = []
    for share in record.shares:
        own_kind = kind if kinds is None else kinds[share.mission_id]
        own = own_fields(record, share, own_kind, {"at": at, **fields})
        is_host = share.mission_id == record.mission_id
        last = record.report_seq if is_host else share.report_seq
        if own is not None:
            # A guest that has just joined knows its arrival times from its booking.
            has_joined = record.mission.state == "QUEUED" and last == 0 and not is_host
            of_share = "QUEUED" if has_joined else own_kind
            sent = _sent(mint, record, share, of_share, last + 1, own)
            _send(tx, record, sent, traceparent=share.traceparent)
            last += 1
        shares.append(share.model_copy(update={"report_seq": last}))
    return replace(record, report_seq=shares[0].report_seq, shares=tuple(shares))


def report_left(work: MissionUnitOfWork, record: MissionRecord) -> None:
    """Report to the registry that a drone does not fly a QUEUED mission any more.

    Another mission carries its packages. The gateway gets the report with this number from that
    mission, under the same id.
    """
    gone = moved(record, "CANCELLED")
    fields = {"at": work.clock.now(), "code": "CALENDAR_CHANGED"}
    sent = _sent(work.mint, gone, gone.mission, "ENDED", record.report_seq + 1, fields)
    with in_trace_of(record.traceparent):
        work.tx.report("registry", MISSION_REPORTS, sent, stream=sent.mission_id)


def _sent(
    mint: Mint,
    record: MissionRecord,
    of: Mission | Share,
    kind: str,
    seq: int,
    fields: Mapping[str, Any],
) -> MissionReport:
    """A report about a mission, as one of its deliveries sees it."""
    mission = record.mission
    return MissionReport.model_validate(
        {
            "report_id": mint("rpt"),
            "delivery_id": of.delivery_id,
            "attempt": of.attempt,
            "trip": of.trip,
            "mission_id": of.mission_id,
            "provider_id": mission.provider_id,
            "drone_id": mission.drone_id,
            "seq": seq,
            "kind": kind,
            "mission_state": mission.state,
            **fields,
        }
    )


def _send(tx: Tx, record: MissionRecord, sent: MissionReport, *, traceparent: str | None) -> None:
    """Send a report to the gateway; the registry gets only the reports of the host."""
    with in_trace_of(traceparent):
        tx.report("gateway", MISSION_REPORTS, sent, stream=sent.mission_id)
        is_of_drone = record.mission.state == "QUEUED" or sent.kind in _OF_THE_DRONE
        if is_of_drone and sent.mission_id == record.mission_id:
            tx.report("registry", MISSION_REPORTS, sent, stream=sent.mission_id)


async def raise_alarm(
    work: MissionUnitOfWork,
    record: MissionRecord,
    *,
    level: AlarmLevel,
    code: str,
    detail: str,
    station_id: StationId | None = None,
    data: Mapping[str, Any] | None = None,  # numbers behind the code
) -> None:
    """Raise an alarm about a mission and its drone now."""
    await alarm_store.add(
        work.tx,
        level=level,
        code=code,
        detail=detail,
        at_ms=moment_to_ms(work.clock.now()),
        mint=work.mint,
        provider_id=record.mission.provider_id,
        drone_id=record.drone_id,
        mission_id=record.mission_id,
        station_id=station_id,
        data=data,
    )


def free_from(record: MissionRecord) -> FreeFrom | None:
    """Where and when the mission's drone can begin another one; None if that is not known."""
    first = next(iter(record.stays), None)
    if first is None:
        return None
    at = ms_to_moment(first.from_ms)
    return FreeFrom(at=at, station_id=first.station_id, soc=first.soc_from)


async def lock_missions(
    context: Context, tx: Tx, delivery_id: DeliveryId
) -> tuple[MissionUnitOfWork, list[MissionRecord], list[MissionRecord]]:
    """The missions that fly for a delivery, and those that are QUEUED; their drones are locked.

    Raises
    ------
    WorldChanged
        The dispatcher has moved a mission to another drone meanwhile.
    """
    drone_ids = await store.drones_serving(tx.connection, delivery_id)
    waiting = await store.queued_of_delivery(tx.connection, delivery_id)
    locked = {*drone_ids, *(each.drone_id for each in waiting)}
    work = await MissionUnitOfWork.lock(context, tx, locked)
    # Read again: a mission may have been sent before its drone was locked.
    drone_ids = await store.drones_serving(tx.connection, delivery_id)
    queued = await store.queued_of_delivery(tx.connection, delivery_id)
    if not locked.issuperset([*drone_ids, *(each.drone_id for each in queued)]):
        # Locking the other drone now could meet a transaction that locks both in order.
        raise WorldChanged(locked)
    flying = [
        work.missions[each]
        for each in drone_ids
        # The drone may have got a mission for another delivery since it was found.
        if each in work.missions and serves(work.missions[each], delivery_id)
    ]
    return work, flying, queued
