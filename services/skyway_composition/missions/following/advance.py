"""Advances a mission: accepted, begun, packages loaded, delivered, returned.

First it judges what the drone says of its steps. If it does not believe the drone, the mission
waits for people.

Each change of custody is saved and reported.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Self

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep, PickUpStep, ReturnStep
from skyway.contracts.mission import Mission
from skyway.ids import DroneId, PackageId, StationId
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.links.instruction_store import last_revision
from skyway_composition.margins import CLOCK_ERROR
from skyway_composition.missions.following.plausibility import (
    Carried,
    HandOver,
    KnownPlace,
    why_impossible,
    why_not_handed_over,
    why_out_of_reach,
    why_too_early,
)
from skyway_composition.missions.interventions.stop_packages import return_cancelled_packages
from skyway_composition.missions.mission.custody_store import (
    ChainLink,
    Custodian,
    Held,
    carried_by,
    may_load,
)
from skyway_composition.missions.mission.end import put_in_doubt
from skyway_composition.missions.mission.proof_store import proofs_of
from skyway_composition.missions.mission.record import MissionRecord, moved
from skyway_composition.missions.mission.share_views import with_pooled_price
from skyway_composition.missions.mission.step_store import StepRecord, flown_totals
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, free_from, report
from skyway_composition.missions.replanning.store import plan_now
from skyway_composition.networks.station_store import stations_named


async def is_believed(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None, event: DroneEvent
) -> bool:
    """Whether this event can have happened; `step` is the planned step that it is about, if any.

    Of a step that failed, `step` is only the part that was done. If the event cannot have happened,
    neither custody nor the step changes: the mission is put in doubt.
    """
    reason = await _why_impossible(work, record, step, event)
    if reason is None:
        return True
    about = (
        "the end of the mission" if event.step_id is None else f"the end of step {event.step_id}"
    )
    await put_in_doubt(
        work,
        record,
        code="IMPLAUSIBLE",
        detail=f"{about} cannot be true: {reason}",
        data={"event": event.model_dump(mode="json", exclude_defaults=True, exclude={"pin"})},
    )
    return False


async def why_not_late_hand_over(
    work: MissionUnitOfWork, ended: MissionRecord, step: DeliverStep | None, event: DroneEvent
) -> str | None:
    """Why this hand-over of a mission that is over cannot be true; None if it can.

    The drone may have loaded without our knowledge, so that it did is not known then.
    """
    ledger = await _Ledger.of(work, ended)
    loaded = ledger.loaded or frozenset(() if step is None else step.package_ids)
    return (
        why_too_early(event, sent_at=_sent_at(work, ended))
        or why_not_handed_over(step, event, ledger.with_masses(loaded))
        or await _why_not_proven(work, ended, step)
        or await _why_out_of_reach(work, ended, ledger, event)
    )


@dataclass(frozen=True, slots=True)
class _Ledger:
    """What is known of a mission: its steps, and who held the packages of its delivery when."""

    record: MissionRecord
    steps: Sequence[StepRecord]
    links: Sequence[ChainLink]

    @classmethod
    async def of(cls, work: MissionUnitOfWork, record: MissionRecord) -> Self:
        return cls(
            record,
            steps=await work.steps.of(record.mission_id),
            links=await work.custody.chain_links(record),
        )

    @classmethod
    async def before_loading(cls, work: MissionUnitOfWork, record: MissionRecord) -> Self:
        """What matters before a mission's only loading: its chains say nothing of its drone."""
        return cls(record, await work.steps.of(record.mission_id), links=())

    @property
    def carried(self) -> frozenset[PackageId]:
        """The packages that the drone has on board."""
        return carried_by({each.held.package_id: each.held for each in self.links}, self.drone_id)

    @property
    def loaded(self) -> frozenset[PackageId]:
        """The packages that the drone has loaded for this mission."""
        return frozenset(each.held.package_id for each in self._own if self._is_loading(each))

    @property
    def drone_id(self) -> DroneId:
        return self.record.drone_id

    def with_masses(self, package_ids: frozenset[PackageId]) -> Carried:
        """These packages with their masses: as planned, or as a loader has measured them."""
        planned = {
            package.package_id: package.mass_kg
            for each in self.steps
            if isinstance(each.step, PickUpStep)
            for package in each.step.packages
        }
        measured = {each.package_id: each.mass_kg for each in self.record.request.packages}
        known = planned | measured
        return Carried({each: known[each] for each in package_ids if each in known})

    def places(self, *, sent_at: datetime) -> list[tuple[StationId, datetime]]:
        """Where the drone was, and when: at the begin of the mission, and at its hand-overs."""
        pickup = self.record.request.pickup.station_id
        handed_over = [
            (pickup if self._is_loading(each) else StationId(each.held.custodian.custodian_id))
            for each in self._own
        ]
        moments = [each.at for each in self._own]
        began = self.record.candidate.station_id, sent_at
        return [began, *zip(handed_over, moments, strict=True)]

    @property
    def _own(self) -> list[ChainLink]:
        """The packages that the drone loaded and delivered in this mission."""
        return [
            each
            for each in self.links
            if each.mission_id == self.record.mission_id
            and each.held.custodian.kind in ("DRONE", "RECIPIENT")
        ]

    def _is_loading(self, link: ChainLink) -> bool:
        return link.held.custodian.kind == "DRONE"


async def _why_impossible(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None, event: DroneEvent
) -> str | None:
    sent_at = _sent_at(work, record)
    reason = why_too_early(event, sent_at=sent_at)
    if reason is not None:
        return reason
    if event.event == "STEP_ENDED" and event.code == "CUT":
        return await _why_not_cut(work, record, event)
    if not isinstance(step, HandOver):
        return None
    if event.event in ("STEP_ENDED", "STEP_FAILED"):
        reason = await _why_not_proven(work, record, step)
    if reason is not None:
        return reason
    read = _Ledger.before_loading if isinstance(step, PickUpStep) else _Ledger.of
    ledger = await read(work, record)
    return why_impossible(
        step,
        event,
        [each for each in ledger.steps if each.step.step_id < step.step_id],
        sent_at=sent_at,
        model=record.candidate.model,
        carried=ledger.with_masses(ledger.carried),
    ) or await _why_out_of_reach(work, record, ledger, event)


def handed_over(step: FlightStep | None, event: DroneEvent) -> DeliverStep | None:
    """The part of a failed DELIVER that was done: some packages had their proofs, others not."""
    if not isinstance(step, DeliverStep) or not step.verification:
        return None
    done = tuple(each for each in step.package_ids if each in event.package_ids)
    is_done = done and event.code == "RECIPIENT_ABSENT"
    return step.model_copy(update={"package_ids": done}) if is_done else None


async def _why_not_proven(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None
) -> str | None:
    """Why these packages cannot have been handed over: one of them has no proof."""
    if not isinstance(step, DeliverStep) or not step.verification:
        return None
    known = await proofs_of(work.tx.connection, record.mission_id, step_id=step.step_id)
    given = {each.flying_id for each in known if each.given_at is not None}
    missing = {each.package_id for each in step.verification} & {*step.package_ids} - given
    return f"no proof is there of {', '.join(sorted(missing))}" if missing else None


async def _why_not_cut(
    work: MissionUnitOfWork, record: MissionRecord, event: DroneEvent
) -> str | None:
    """Why nothing has cut this step short; None if a later plan was sent that may have."""
    revision = max(1, event.mission_revision or 1)
    if await last_revision(work.tx, record.mission_id) > revision:
        return None
    return f"it was cut in revision {revision} of the plan, and no later one was sent"


async def _why_out_of_reach(
    work: MissionUnitOfWork, record: MissionRecord, ledger: _Ledger, event: DroneEvent
) -> str | None:
    if event.station_id is None:
        return None
    places = ledger.places(sent_at=_sent_at(work, record))
    station_ids = {event.station_id, *(station_id for station_id, _ in places)}
    if len(station_ids) == 1:
        return None
    stations = await stations_named(work.tx.connection, sorted(station_ids))
    here = stations.get(event.station_id)
    known = [
        KnownPlace(station_id, stations[station_id].position, at)
        for station_id, at in places
        if station_id in stations
    ]
    position = None if here is None else here.position
    return why_out_of_reach(event, position, known, record.candidate.model)


def _sent_at(work: MissionUnitOfWork, record: MissionRecord) -> datetime:
    """The earliest moment at which the drone can have got the mission, by its own clock."""
    sent_at = ms_to_moment(record.expires_ms) - work.courier.lifetime
    return sent_at - CLOCK_ERROR.span(work.clock)


def accept(work: MissionUnitOfWork, record: MissionRecord) -> MissionRecord:
    """Note that the drone has accepted the mission; a drone that flies it has accepted it."""
    if record.mission.state != "BOOKED":
        return record
    record = moved(record, "ACCEPTED")
    return report(work, record, "ACCEPTED", free_from=free_from(record))


def begin(work: MissionUnitOfWork, record: MissionRecord, *, at: datetime) -> MissionRecord:
    """Note that the drone has begun: it approaches the pickup, or loads there."""
    record = accept(work, record)
    if record.mission.state != "ACCEPTED":
        return record
    record = moved(record, "ACTIVE")
    return report(work, record, "LOADING", at=at)


async def record_loading(
    work: MissionUnitOfWork, record: MissionRecord, step: PickUpStep, event: DroneEvent
) -> MissionRecord:
    """Note which packages are on board; cancelled packages are brought back."""
    requested = {each.package_id for each in record.request.packages}
    # A loader confirms only packages that are still requested.
    planned = {each.package_id for each in step.packages}
    default = planned & requested if step.awaits_confirmation else planned
    taken = set(event.package_ids) or default
    package_ids = [each.package_id for each in step.packages if each.package_id in taken]
    drone = Custodian("DRONE", record.drone_id)
    passed = await _pass_on(work, record, package_ids, to=drone, event=event)
    if passed:
        record = _report_loaded(work, record, event, passed)
    if passed and record.needs_plan:
        # Planning may wait for the drone's cancellation, which now comes too late.
        await plan_now(work.tx, record.mission_id)
    cancelled = [each for each in step.packages if each.package_id in taken - requested]
    return await return_cancelled_packages(work, record, cancelled) if cancelled else record


async def record_hand_over(
    work: MissionUnitOfWork, record: MissionRecord, step: DeliverStep, event: DroneEvent
) -> MissionRecord:
    """Note that recipients have their packages, and report the totals so far."""
    recipient = Custodian("RECIPIENT", step.station_id)
    passed = await _pass_on(work, record, step.package_ids, to=recipient, event=event)
    flown = flown_totals(await work.steps.ended_events(record.mission_id))
    return _report(work, record, "DELIVERED", event, passed, flown=flown)


async def record_return(
    work: MissionUnitOfWork, record: MissionRecord, step: ReturnStep, event: DroneEvent
) -> MissionRecord:
    """Note that a station has packages back.

    Packages that are handed back elsewhere than at the pickup are stranded; the report at the end
    of the mission names them.
    """
    station = Custodian("STATION", step.station_id)
    passed = await _pass_on(work, record, step.package_ids, to=station, event=event)
    if not passed or step.station_id != record.request.pickup.station_id:
        return record
    return _report(work, record, "RETURNED", event, passed)


def _report_loaded(
    work: MissionUnitOfWork,
    record: MissionRecord,
    event: DroneEvent,
    package_ids: tuple[PackageId, ...],
) -> MissionRecord:
    """Report what is on board; deliveries that were loaded together pay the pooled price."""
    pooled = with_pooled_price(record, package_ids)
    mission = None if pooled is record else pooled.mission
    return _report(work, pooled, "LOADED", event, package_ids, mission=mission)


def _report(
    work: MissionUnitOfWork,
    record: MissionRecord,
    kind: str,
    event: DroneEvent,
    package_ids: tuple[PackageId, ...],
    *,
    flown: dict[str, float] | None = None,
    mission: Mission | None = None,
) -> MissionRecord:
    return report(
        work,
        record,
        kind,
        at=event.ended_at,
        station_id=event.station_id,
        soc=event.soc,
        package_ids=package_ids,
        mission=mission,
        data=event.data if flown is None else {**event.data, "flown": flown},
    )


async def _pass_on(
    work: MissionUnitOfWork,
    record: MissionRecord,
    package_ids: Iterable[PackageId],
    *,
    to: Custodian,
    event: DroneEvent,
) -> tuple[PackageId, ...]:
    """Pass on those of these packages that their custodian has to pass on.

    A drone loads what a station has, and hands over only what it has itself.
    """
    held = await work.custody.held_on(record)
    if to.kind == "DRONE":
        passed = [each for each in package_ids if may_load(held.get(each))]
    else:
        carried = carried_by(held, record.drone_id)
        passed = [each for each in package_ids if each in carried]
    rows = [Held(each, held[each].seq + 1 if each in held else 1, to) for each in passed]
    await work.custody.add(record, rows, at_ms=moment_to_ms(event.ended_at))
    return tuple(passed)
