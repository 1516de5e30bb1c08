"""Proof of a hand-over: place, time, the drone, and its load before and after."""

from collections.abc import Mapping
from typing import Any, Self

from pydantic import TypeAdapter, ValidationError

from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import MissionReport
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import WireModel

_NUMBER = TypeAdapter(float | None)
_POSITION = TypeAdapter(Position | None)


class Proof(WireModel):
    """What a drone reported when it handed a package over, to a recipient or back to a station.

    `load_before_kg` and `load_after_kg` are of the whole hand-over, in which other packages may
    have left the drone too; `mass_kg` is of this package alone.
    """

    station_id: StationId | None
    position: Position | None = None
    at: FleetMoment
    mission_id: MissionId
    provider_id: ProviderId
    drone_id: DroneId
    soc: Soc | None = None
    mass_kg: float | None = None
    load_before_kg: float | None = None
    load_after_kg: float | None = None

    @classmethod
    def of(cls, report: MissionReport, package_id: PackageId) -> Self:
        """The proof of this package in a report; evidence in an unknown form is left out."""
        evidence = report.data
        masses_kg, place = evidence.get("mass_kg"), evidence.get("place")
        mass_kg = masses_kg.get(package_id) if isinstance(masses_kg, Mapping) else None
        position = place.get("position") if isinstance(place, Mapping) else None
        return cls(
            station_id=report.station_id,
            position=_read(_POSITION, position),
            at=report.at,
            mission_id=report.mission_id,
            provider_id=report.provider_id,
            drone_id=report.drone_id,
            soc=report.soc,
            mass_kg=_read(_NUMBER, mass_kg),
            load_before_kg=_read(_NUMBER, evidence.get("load_before_kg")),
            load_after_kg=_read(_NUMBER, evidence.get("load_after_kg")),
        )


def _read(form: TypeAdapter[Any], value: object) -> Any:  # of the adapter's type, or None
    # Evidence that cannot be read must not hold up the delivery.
    try:
        return form.validate_python(value)
    except ValidationError:
        return None
