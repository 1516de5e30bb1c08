"""All SQL of the quarantine."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import ColumnElement, Row, case, delete, func, select
from sqlalchemy.dialects import postgresql
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import ProviderId, QuarantineId
from skyway.runtime.minting import Mint
from skyway.runtime.sql.database import Tx
from skyway.units import ms_to_moment
from skyway_composition.quarantine.quarantined import (
    QuarantinedMessage,
    SetAsideMessage,
    shown_payload,
)
from skyway_composition.tables import quarantine

#: The most rows of one sender, of one provider, and in all: 40 MiB at most. Our own choice.
MOST_OF_SENDER: Final = 20
MOST_OF_PROVIDER: Final = 500
MOST_ROWS: Final = 5_000


@dataclass(frozen=True, slots=True)
class Arrival:
    """When messages were set aside, in fleet time and in wall time."""

    at_ms: int
    wall_ms: int


async def add_all(
    tx: Tx, messages: Sequence[SetAsideMessage], *, arrival: Arrival, mint: Mint
) -> int:
    """Keep messages as far as there is room; the result is how many were left out.

    A message that is kept already is counted in its row.
    """
    known = await _known(tx, messages)
    rows = await _rows_by_sender(tx, {each.provider_id for each in messages})
    total = (await tx.execute(select(func.count()).select_from(quarantine))).scalar_one()
    left_out = 0
    for each in messages:
        sender = (each.provider_id, each.drone_id)
        of_provider = sum(
            count for (provider_id, _), count in rows.items() if provider_id == sender[0]
        )
        is_known = (each.topic, each.payload_sha256) in known
        has_room = (
            rows[sender] < MOST_OF_SENDER and of_provider < MOST_OF_PROVIDER and total < MOST_ROWS
        )
        if not is_known and not has_room:
            left_out += 1
            continue
        await tx.execute(_ADD, _values(each, arrival, mint))
        if not is_known:
            known.add((each.topic, each.payload_sha256))
            rows[sender] += 1
            total += 1
    return left_out


async def _known(tx: Tx, messages: Sequence[SetAsideMessage]) -> set[tuple[str, str]]:
    """Topic and hash of those messages that are kept already."""
    hashes = [each.payload_sha256 for each in messages]
    found = await tx.execute(
        select(quarantine.c.topic, quarantine.c.payload_sha256).where(
            quarantine.c.payload_sha256.in_(hashes)
        )
    )
    return {(row.topic, row.payload_sha256) for row in found}


async def _rows_by_sender(tx: Tx, provider_ids: set[ProviderId]) -> Counter[tuple[str, str]]:
    """How many messages of each sender of these providers are kept."""
    sender = (quarantine.c.provider_id, quarantine.c.drone_id)
    found = await tx.execute(
        select(*sender, func.count().label("rows"))
        .where(quarantine.c.provider_id.in_(sorted(provider_ids)))
        .group_by(*sender)
    )
    return Counter({(row.provider_id, row.drone_id): row.rows for row in found})


def _values(each: SetAsideMessage, arrival: Arrival, mint: Mint) -> dict[str, object]:
    return {
        "quarantine_id": mint("qua"),
        "topic": each.topic,
        "provider_id": each.provider_id,
        "drone_id": each.drone_id,
        "reason": each.reason,
        "detail": each.detail,
        "payload": each.payload,
        "payload_sha256": each.payload_sha256,
        "size_bytes": each.size_bytes,
        "times": 1,
        "first_ms": arrival.at_ms,
        "last_ms": arrival.at_ms,
        "last_wall_ms": arrival.wall_ms,
    }


def _again() -> dict[str, Any]:  # the values of columns of every type
    """What changes when the same message comes again, or another replica has kept it first."""
    new = _INSERT.excluded
    return {
        "times": quarantine.c.times + 1,
        "last_ms": _later(quarantine.c.last_ms, new.last_ms),
        "last_wall_ms": _later(quarantine.c.last_wall_ms, new.last_wall_ms),
        "reason": new.reason,
        "detail": new.detail,
    }


def _later(kept: ColumnElement[int], new: ColumnElement[int]) -> ColumnElement[int]:
    return case((kept > new, kept), else_=new)


# This also works with SQLite: both dialects write ON CONFLICT in the same way.
_INSERT: Final = postgresql.insert(quarantine)
_ADD: Final = _INSERT.on_conflict_do_update(
    index_elements=["topic", "payload_sha256"], set_=_again()
)


@dataclass(frozen=True, slots=True)
class KeptPayload:
    """A kept message as it arrived: topic and payload, and whether the payload is whole.

    It arrived first at `first_ms`, fleet time.
    """

    topic: str
    payload: bytes
    is_whole: bool
    first_ms: int


async def payload_of(
    connection: AsyncConnection, quarantine_id: QuarantineId
) -> KeptPayload | None:
    """The payload of a message; None when it is not kept."""
    query = select(quarantine).where(quarantine.c.quarantine_id == quarantine_id)
    row = (await connection.execute(query)).one_or_none()
    if row is None:
        return None
    is_whole = len(row.payload) == row.size_bytes
    return KeptPayload(row.topic, row.payload, is_whole=is_whole, first_ms=row.first_ms)


async def remove(tx: Tx, quarantine_id: QuarantineId) -> bool:
    """Delete a message; False when it is not kept."""
    gone = delete(quarantine).where(quarantine.c.quarantine_id == quarantine_id)
    return (await tx.execute(gone)).rowcount == 1


async def remove_old(tx: Tx, *, before_wall_ms: int) -> int:
    """Delete the messages that came last before this moment; the result is how many."""
    gone = delete(quarantine).where(quarantine.c.last_wall_ms < before_wall_ms)
    return (await tx.execute(gone)).rowcount


async def page(
    connection: AsyncConnection, *, provider_id: str | None, before: str | None, limit: int
) -> list[QuarantinedMessage]:
    """Messages whose id comes before a given one, the newest first."""
    query = select(quarantine).order_by(quarantine.c.quarantine_id.desc()).limit(limit)
    if provider_id is not None:
        query = query.where(quarantine.c.provider_id == provider_id)
    if before is not None:
        query = query.where(quarantine.c.quarantine_id < before)
    return [quarantined(row) for row in await connection.execute(query)]


def quarantined(row: Row[*tuple[Any, ...]]) -> QuarantinedMessage:
    """The message in a row of `quarantine`."""
    return QuarantinedMessage(
        quarantine_id=row.quarantine_id,
        reason=row.reason,
        detail=row.detail,
        topic=row.topic,
        provider_id=row.provider_id,
        drone_id=row.drone_id,
        received_at=ms_to_moment(row.first_ms),
        last_received_at=ms_to_moment(row.last_ms),
        times=row.times,
        payload=shown_payload(row.payload),
        size_bytes=row.size_bytes,
        is_whole=len(row.payload) == row.size_bytes,
    )
