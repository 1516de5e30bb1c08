"""Between a delivery's packages and their rows, and the first links of their custody."""

from datetime import datetime
from typing import Final

from pydantic import TypeAdapter

from skyway.delivery.request import Place
from skyway.geo import Position
from skyway.runtime.sql.connection import AnyRow
from skyway.units import moment_to_ms, ms_to_moment
from skyway_gateway.deliveries.delivery import Custodian, Delivery, PackageStatus
from skyway_gateway.deliveries.proof import Proof
from skyway_gateway.deliveries.rows.values import Values

_POSITION: Final = TypeAdapter(Position)


def new_packages(delivery: Delivery) -> list[Values]:
    """The rows of its packages."""
    return [
        {
            "delivery_id": delivery.delivery_id,
            "package_id": package.package_id,
            "number": number,
            "destination_station_id": package.destination.station_id,
            "mass_kg": package.mass_kg,
            "custody_seq": 1,
            **package_values(package),
        }
        for number, package in enumerate(delivery.packages)
    ]


def package_values(package: PackageStatus) -> Values:
    """The columns of a package that change during its life."""
    return {
        "state": package.state,
        "custodian_kind": package.custodian.kind,
        "custodian_id": package.custodian.id,
        "promised_ms": _ms(package.promised_at),
        "eta_ms": _ms(package.eta_at),
        "delivered_ms": _ms(package.delivered_at),
        "mission_id": package.mission_id,
        "code": package.code,
        "detail": package.detail,
        "proof": package.proof and package.proof.model_dump_json(),
        "position": package.position and _POSITION.dump_json(package.position).decode(),
    }


def first_custody_row(delivery: Delivery, package: PackageStatus) -> Values:
    """The first link of a package's chain of custody."""
    return {
        "delivery_id": delivery.delivery_id,
        "package_id": package.package_id,
        "seq": 1,
        "custodian_kind": package.custodian.kind,
        "custodian_id": package.custodian.id,
        "at_ms": moment_to_ms(delivery.updated_at),
    }


def package_of(row: AnyRow) -> PackageStatus:
    """The package in a row."""
    return PackageStatus(
        package_id=row.package_id,
        state=row.state,
        destination=Place(station_id=row.destination_station_id),
        mass_kg=row.mass_kg,
        custodian=Custodian(kind=row.custodian_kind, id=row.custodian_id),
        promised_at=_moment(row.promised_ms),
        eta_at=_moment(row.eta_ms),
        delivered_at=_moment(row.delivered_ms),
        mission_id=row.mission_id,
        code=row.code,
        detail=row.detail,
        proof=None if row.proof is None else Proof.read(row.proof),
        position=None if row.position is None else _POSITION.validate_json(row.position),
    )


def _ms(moment: datetime | None) -> int | None:
    return None if moment is None else moment_to_ms(moment)


def _moment(moment_ms: int | None) -> datetime | None:
    return None if moment_ms is None else ms_to_moment(moment_ms)
