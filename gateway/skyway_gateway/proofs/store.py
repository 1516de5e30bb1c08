"""All SQL of proofs: one row for each package that is handed over only with a proof."""

from collections.abc import Collection, Mapping
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy import BigInteger, and_, bindparam, delete, exists, select, update
from sqlalchemy.ext.asyncio import AsyncConnection

from skyway.ids import DeliveryId, PackageId
from skyway.runtime.sql.connection import AnyRow
from skyway.runtime.sql.database import Tx
from skyway.runtime.sql.in_list import in_list
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.delivery_tables import packages, proofs
from skyway_gateway.proofs.signature import Signature
from skyway_gateway.proofs.verification import (
    MOST_WRONG_PINS,
    CustomerVerification,
    DropoffProof,
    GivenBy,
    new_pin,
)

#: The photos that one step erases at most.
BATCH: Final = 100

_OF_DELIVERIES: Final = select(proofs).where(in_list(proofs.c.delivery_id, "delivery_ids"))
_THIS: Final = and_(
    proofs.c.delivery_id == bindparam("this"), proofs.c.package_id == bindparam("package")
)
_IS_OPEN: Final = proofs.c.given_ms.is_(None)
_NOTE_WRONG: Final = (
    update(proofs)
    .where(_THIS, _IS_OPEN, proofs.c.wrong_pins < MOST_WRONG_PINS)
    .values(wrong_pins=proofs.c.wrong_pins + 1)
)
_GIVE: Final = update(proofs).where(_THIS, _IS_OPEN)

#: A PIN is of no use once its package is settled or comes back.
_ERASE_PINS: Final = (
    update(proofs)
    .where(
        proofs.c.pin.is_not(None),
        exists().where(
            packages.c.delivery_id == proofs.c.delivery_id,
            packages.c.package_id == proofs.c.package_id,
            packages.c.state.not_in(("CREATED", "LOADED", "IN_TRANSIT")),
        ),
    )
    .values(pin=None)
)
_IS_DUE: Final = and_(
    proofs.c.due_ms.is_not(None),
    proofs.c.due_ms <= bindparam("now_ms", type_=BigInteger),
)
_DUE: Final = (
    select(proofs.c.delivery_id, proofs.c.package_id)
    .where(_IS_DUE)
    .order_by(proofs.c.due_ms)
    .limit(BATCH)
)
_PHOTOS_OF: Final = select(proofs.c.delivery_id, proofs.c.package_id).where(
    in_list(proofs.c.delivery_id, "delivery_ids"), proofs.c.has_photo
)
_ERASED: Final = {"signature": None, "has_photo": False, "due_ms": None}

#: A package of a delivery.
PackageKey = tuple[DeliveryId, PackageId]


async def of_delivery(
    connection: AsyncConnection, delivery_id: DeliveryId
) -> Mapping[str, DropoffProof]:
    """The proofs of the packages of a delivery that are handed over only with one."""
    found = await connection.execute(_OF_DELIVERIES, {"delivery_ids": [delivery_id]})
    return {row.package_id: _proof_of(row) for row in found}


async def signature_of(connection: AsyncConnection, key: PackageKey) -> Signature | None:
    """The signature for a package; None without one."""
    found = await connection.execute(select(proofs.c.signature).where(_THIS), _named(key))
    stored: str | None = found.scalar_one_or_none()
    return None if stored is None else Signature.read(stored)


def add(tx: Tx, delivery_id: DeliveryId, asked: Mapping[PackageId, CustomerVerification]) -> None:
    """Add the proofs of a delivery that the block adds; PINs that are not given are made."""
    rows = [
        {"delivery_id": delivery_id, "package_id": package_id, **_asked(each)}
        for package_id, each in asked.items()
    ]
    tx.add(proofs, rows)


async def replace(tx: Tx, key: PackageKey, asked: CustomerVerification | None) -> None:
    """Ask for another proof, or for none, of a package whose proof is not given."""
    if asked is None:
        await tx.execute(delete(proofs).where(_THIS, _IS_OPEN), _named(key))
        return
    values = _asked(asked)
    statement = tx.insert(proofs).values(delivery_id=key[0], package_id=key[1], **values)
    await tx.execute(
        statement.on_conflict_do_update(
            index_elements=["delivery_id", "package_id"], set_=values, where=_IS_OPEN
        )
    )


async def note_wrong_pin(tx: Tx, key: PackageKey) -> None:
    """Count a wrong PIN."""
    await tx.execute(_NOTE_WRONG, _named(key))


async def give(
    tx: Tx,
    key: PackageKey,
    *,
    by: GivenBy,
    at: datetime,
    kept: timedelta,
    signature: Signature | None = None,
    has_photo: bool = False,
) -> bool:
    """Store that the proof is given; False if it was given before. Its PIN leaves."""
    has_picture = signature is not None or has_photo
    values = {
        "given_by": by,
        "given_ms": moment_to_ms(at),
        "pin": None,
        "signature": signature and signature.model_dump_json(),
        "has_photo": has_photo,
        "due_ms": moment_to_ms(at + kept) if has_picture else None,
    }
    return (await tx.execute(_GIVE.values(values), _named(key))).rowcount == 1


async def erase_pins(tx: Tx) -> None:
    """Erase the PINs of packages that are not handed over with them any more."""
    await tx.execute(_ERASE_PINS)


async def make_due(tx: Tx, delivery_id: DeliveryId, *, at: datetime) -> tuple[str, ...]:
    """Let the pictures of a delivery be erased as soon as possible; their names for people."""
    this = and_(proofs.c.delivery_id == delivery_id, proofs.c.due_ms.is_not(None))
    # A signature leaves now, and a photo with its file.
    values = {"signature": None, "due_ms": moment_to_ms(at)}
    made = update(proofs).where(this).values(values).returning(proofs.c.package_id)
    found = (await tx.execute(made)).scalars()
    return tuple(f"packages.{each}.dropoff_proof.picture" for each in sorted(found))


async def due(connection: AsyncConnection, *, at: datetime) -> list[PackageKey]:
    """Some of the packages whose pictures are to be erased at this moment of fleet time."""
    rows = await connection.execute(_DUE, {"now_ms": moment_to_ms(at)})
    return [(row.delivery_id, row.package_id) for row in rows]


async def photos_of(
    connection: AsyncConnection, delivery_ids: Collection[DeliveryId]
) -> list[PackageKey]:
    """The packages of these deliveries that have photos."""
    rows = await connection.execute(_PHOTOS_OF, {"delivery_ids": sorted(delivery_ids)})
    return [(row.delivery_id, row.package_id) for row in rows]


async def note_erased(tx: Tx, erased: Collection[PackageKey]) -> None:
    """Store that the photos of these packages are gone, and erase their signatures."""
    for key in sorted(erased):
        await tx.execute(update(proofs).where(_THIS).values(_ERASED), _named(key))


def _named(key: PackageKey) -> dict[str, object]:
    return {"this": key[0], "package": key[1]}


def _asked(asked: CustomerVerification) -> dict[str, object]:
    pin = (asked.pin or new_pin()) if asked.method == "PIN" else None
    return {"method": asked.method, "pin": pin, "wrong_pins": 0}


def _proof_of(row: AnyRow) -> DropoffProof:
    picture = "image/svg+xml" if row.signature else "image/jpeg" if row.has_photo else None
    return DropoffProof(
        method=row.method,
        pin=row.pin,
        wrong_pins=row.wrong_pins,
        given_at=None if row.given_ms is None else ms_to_moment(row.given_ms),
        given_by=row.given_by,
        picture=picture,
    )
