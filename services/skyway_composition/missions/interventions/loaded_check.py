"""Compares what a loader has loaded with what was agreed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from skyway.contracts.flight_step import PackageOnBoard
from skyway.delivery.request import Package
from skyway.errors import InvalidInput
from skyway.ids import PackageId
from skyway_composition.missions.mission.record import MissionRecord

#: A measured mass may differ by the larger of these, kilograms and a share. Our own choices.
_TOLERANCE_KG: Final = 0.05
_TOLERANCE: Final = 0.05
#: A payload above the limit by less than this is rounding.
_ROUNDING_KG: Final = 1e-9


@dataclass(frozen=True, slots=True)
class LoadingFault:
    """Why a drone does not take off with its load: a code, a sentence, the numbers."""

    code: str
    detail: str
    data: Mapping[str, Any] = field(default_factory=dict)  # names and masses


def refuse_unknown_packages(record: MissionRecord, listed: Sequence[PackageOnBoard]) -> None:
    """Check that each listed package belongs to the mission and is listed once.

    Raises
    ------
    InvalidInput
        Names the entry at fault.
    """
    unlisted = {each.package_id for each in record.request.packages}
    for number, each in enumerate(listed):
        if each.package_id not in unlisted:
            detail = f"{each.package_id!r} is listed twice, or not for {record.mission_id}"
            raise InvalidInput(f"packages.{number}.package_id", detail)
        unlisted.remove(each.package_id)


def loading_fault(record: MissionRecord, listed: Sequence[PackageOnBoard]) -> LoadingFault | None:
    """The first fault of a loading; None when all is as agreed."""
    measured_kg = {each.package_id: each.mass_kg for each in listed}
    return (
        _missing(record, measured_kg)
        or _mismatched(record.request.packages, measured_kg)
        or _too_heavy(record, measured_kg)
    )


def _missing(record: MissionRecord, measured_kg: Mapping[PackageId, float]) -> LoadingFault | None:
    missing = [
        each.package_id for each in record.request.packages if each.package_id not in measured_kg
    ]
    if not missing:
        return None
    return LoadingFault(
        "PACKAGE_MISSING",
        f"not at the pickup: {', '.join(missing)}",
        {"package_ids": missing},
    )


def _mismatched(
    packages: Sequence[Package], measured_kg: Mapping[PackageId, float]
) -> LoadingFault | None:
    for package in packages:
        mass_kg = measured_kg[package.package_id]
        tolerance_kg = max(_TOLERANCE_KG, _TOLERANCE * package.mass_kg)
        if abs(mass_kg - package.mass_kg) > tolerance_kg + _ROUNDING_KG:
            return LoadingFault(
                "MASS_MISMATCH",
                f"{package.package_id} weighs {mass_kg:g} kg, {package.mass_kg:g} kg were agreed",
                {
                    "package_id": package.package_id,
                    "mass_kg": mass_kg,
                    "agreed_kg": package.mass_kg,
                },
            )
    return None


def _too_heavy(
    record: MissionRecord, measured_kg: Mapping[PackageId, float]
) -> LoadingFault | None:
    payload_kg, model = sum(measured_kg.values()), record.candidate.model
    if payload_kg <= model.max_payload_kg + _ROUNDING_KG:
        return None
    return LoadingFault(
        "MASS_MISMATCH",
        f"payload {payload_kg:g} kg exceeds the {model.max_payload_kg:g} kg limit of "
        f"{model.model_id}",
        {"mass_kg": payload_kg, "limit_kg": model.max_payload_kg},
    )
