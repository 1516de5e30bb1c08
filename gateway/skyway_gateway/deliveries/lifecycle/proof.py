"""Proof of a hand-over: place, time, the drone, and its load before and after."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, TypeAdapter, ValidationError

from skyway.contracts.message import FleetMoment, Soc
from skyway.contracts.mission import MissionReport
from skyway.geo import Position
from skyway.ids import DroneId, MissionId, PackageId, ProviderId, StationId
from skyway.json_model import WireModel

_NUMBER = TypeAdapter(float | None)
_POSITION = TypeAdapter(Position | None)


class Proof(WireModel):
    """What a drone reported when it handed a package over, to a recipient or back to a station.

    One hand-over may concern several packages: the loads are of all, `mass_kg` is of this package.
    """

    station_id: Annotated[
        StationId | None,
        Field(description="Where the package was handed over; null away from every station."),
    ]
    position: Annotated[
        Position | None,
        Field(description="Where the drone stood: longitude and latitude, degrees."),
    ] = None
    at: FleetMoment
    mission_id: Annotated[MissionId, Field(description="The mission that carried it.")]
    provider_id: Annotated[ProviderId, Field(description="The provider of the drone.")]
    drone_id: Annotated[DroneId, Field(description="The drone that carried it.")]
    soc: Annotated[
        Soc | None, Field(description="The drone's state of charge at the hand-over.")
    ] = None
    mass_kg: Annotated[
        float | None, Field(description="The measured mass of this package, kilograms.")
    ] = None
    load_before_kg: Annotated[
        float | None, Field(description="What the drone carried before the hand-over, kilograms.")
    ] = None
    load_after_kg: Annotated[
        float | None, Field(description="What the drone carried after the hand-over, kilograms.")
    ] = None

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
