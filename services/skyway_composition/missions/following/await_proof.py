"""Handles what a drone reports while it waits for the proofs of a hand-over."""

import logging
from datetime import timedelta
from functools import partial
from typing import Final

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep
from skyway_composition.missions.following.advance import begin
from skyway_composition.missions.mission.proof_store import (
    Proof,
    add_awaited,
    count_pin,
    proofs_of,
)
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share_views import owner_of
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, report

log = logging.getLogger(__name__)

#: The most PINs for one package that are passed on from a drone in one wait. The gateway allows
#: fewer wrong ones. Our own choice.
_MOST_PINS: Final = 10


async def handle_awaited_proofs(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None, event: DroneEvent
) -> None:
    """Note that the drone waits for proofs, and report it; a repeated event changes nothing."""
    if not isinstance(step, DeliverStep) or not step.verification:
        return
    if await proofs_of(work.tx.connection, record.mission_id, step_id=step.step_id):
        return
    since_at = event.started_at or event.ended_at
    until_at = since_at + timedelta(seconds=step.recipient_wait_s)
    owner = partial(owner_of, record)
    await add_awaited(work.tx, record.mission_id, step, owner_of=owner, until_at=until_at)
    work.stage(
        report(
            work,
            begin(work, record, at=since_at),
            "PROOF_AWAITED",
            at=since_at,
            station_id=step.station_id,
            soc=event.soc,
            package_ids=tuple(each.package_id for each in step.verification),
            until_at=until_at,
        )
    )


async def handle_entered_pin(
    work: MissionUnitOfWork, record: MissionRecord, step: FlightStep | None, event: DroneEvent
) -> None:
    """Pass a PIN on to the gateway, which knows the right one; it is not stored here."""
    if not isinstance(step, DeliverStep) or event.pin is None:
        return
    proof = await _typed_for(work, record, step, event)
    if proof is None or proof.pins >= _MOST_PINS:
        log.warning("PIN not passed on", extra={"mission_id": record.mission_id})
        return
    await count_pin(work.tx, proof)
    package_ids = (proof.flying_id,)
    work.stage(
        report(
            work, record, "PIN_ENTERED", at=event.ended_at, package_ids=package_ids, pin=event.pin
        )
    )


async def _typed_for(
    work: MissionUnitOfWork, record: MissionRecord, step: DeliverStep, event: DroneEvent
) -> Proof | None:
    """The PIN's proof: that of the named package, or the only one that is still awaited."""
    awaited = [
        each
        for each in await proofs_of(work.tx.connection, record.mission_id, step_id=step.step_id)
        if each.method == "PIN"
        and each.given_at is None
        and each.flying_id in (event.package_ids or step.package_ids)
    ]
    return awaited[0] if len(awaited) == 1 else None
