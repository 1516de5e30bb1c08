"""The proofs that drones wait for at hand-overs, and all their SQL."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import Row, insert, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.contracts.flight_step import DeliverStep
from skyway.delivery.verification import ProofMethod
from skyway.ids import DeliveryId, MissionId, PackageId
from skyway.runtime.sql.database import Tx
from skyway.units import moment_to_ms, ms_to_moment
from skyway_composition.tables import proofs

_ADD: Final = insert(proofs)


@dataclass(frozen=True, slots=True)
class Proof:
    """A proof that a drone waits for, or has waited for; `flying_id` is the package on board.

    `given_at` is when the proof came; None without one. `pins` is how often somebody typed a PIN
    for it at the drone.
    """

    mission_id: MissionId
    step_id: int
    flying_id: PackageId
    method: ProofMethod
    until_at: datetime
    given_at: datetime | None
    pins: int


async def add_awaited(
    tx: Tx,
    mission_id: MissionId,
    step: DeliverStep,
    *,
    owner_of: Callable[[PackageId], tuple[DeliveryId, PackageId]],
    until_at: datetime,
) -> None:
    """Note that the drone of a mission waits for the proofs of this step.

    `owner_of` says the delivery of a package on board, and the customer's id of the package.
    """
    common = {
        "mission_id": mission_id,
        "step_id": step.step_id,
        "until_ms": moment_to_ms(until_at),
        "pins": 0,
    }
    names = ("delivery_id", "package_id")
    rows = [
        {
            **common,
            "flying_id": each.package_id,
            "method": each.method,
            **dict(zip(names, owner_of(each.package_id), strict=True)),
        }
        for each in step.verification
    ]
    await tx.execute(_ADD, rows)


async def proofs_of(
    connection: AsyncConnection, mission_id: MissionId, *, step_id: int
) -> list[Proof]:
    """The proofs that the drone waits for, or has waited for, in a step."""
    found = await connection.execute(
        select(proofs)
        .where(proofs.c.mission_id == mission_id, proofs.c.step_id == step_id)
        .order_by(proofs.c.flying_id)
    )
    return [_proof(row) for row in found]


async def last_proof(
    connection: AsyncConnection, delivery_id: DeliveryId, package_id: PackageId
) -> Proof | None:
    """The proof that a drone waited for last, by the customer's id of the package."""
    found = await connection.execute(
        select(proofs)
        .where(proofs.c.delivery_id == delivery_id, proofs.c.package_id == package_id)
        .order_by(proofs.c.until_ms.desc(), proofs.c.step_id.desc())
        .limit(1)
    )
    row = found.one_or_none()
    return None if row is None else _proof(row)


async def note_given(tx: Tx, proof: Proof, *, at_ms: int) -> None:
    """Note that a proof is there."""
    await tx.execute(_of(proof).values(given_ms=at_ms))


async def count_pin(tx: Tx, proof: Proof) -> None:
    """Count a PIN that was typed at the drone."""
    await tx.execute(_of(proof).values(pins=proof.pins + 1))


def _of(proof: Proof) -> Any:  # an update, whose type depends on its table
    return update(proofs).where(
        proofs.c.mission_id == proof.mission_id,
        proofs.c.step_id == proof.step_id,
        proofs.c.flying_id == proof.flying_id,
    )


def _proof(row: Row[Any]) -> Proof:  # a row of proofs
    return Proof(
        row.mission_id,
        row.step_id,
        row.flying_id,
        row.method,
        until_at=ms_to_moment(row.until_ms),
        given_at=None if row.given_ms is None else ms_to_moment(row.given_ms),
        pins=row.pins,
    )
