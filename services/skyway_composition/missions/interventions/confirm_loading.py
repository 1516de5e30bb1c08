"""Confirms a loading: the measured masses go into the plan, or the mission ends.

A loading is refused when the load differs from what was agreed, or is too heavy.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from skyway.contracts.flight_step import PackageOnBoard
from skyway.delivery.request import Package
from skyway.errors import InvalidInput
from skyway.ids import MissionId, PackageId, ProviderId
from skyway.json_model import JsonModel
from skyway.runtime.errors import Conflict
from skyway_composition.context import Context
from skyway_composition.missions.interventions.stop_packages import (
    PACKAGES_CANCELLED,
)
from skyway_composition.missions.mission import end as ending
from skyway_composition.missions.mission import store
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import (
    MissionUnitOfWork,
    lock_mission,
    raise_alarm,
)
from skyway_composition.missions.replanning.check_plan import request_plan

#: A measured mass may differ by the larger of these, kilograms and a share. Our own choices.
_TOLERANCE_KG: Final = 0.05
_TOLERANCE: Final = 0.05
#: A payload above the limit by less than this is rounding.
_ROUNDING_KG: Final = 1e-9


class LoadingAnswer(JsonModel):
    """The answer to a loader.

    CONFIRMED: the drone takes off once its plan holds with these masses. REFUSED: the mission
    has ended.
    """

    outcome: Annotated[
        Literal["CONFIRMED", "REFUSED"],
        Field(description="CONFIRMED, or REFUSED: then the mission has ended."),
    ]
    code: Annotated[
        str | None, Field(description="Why it was refused: PACKAGE_MISSING or MASS_MISMATCH.")
    ] = None
    detail: Annotated[str | None, Field(description="The reason as a sentence.")] = None


@dataclass(frozen=True, slots=True)
class LoadingFault:
    """Why a drone does not take off with its load: a code, a sentence, the numbers."""

    code: str
    detail: str
    data: Mapping[str, Any] = field(default_factory=dict)  # names and masses


async def handle_confirmation(
    context: Context,
    mission_id: MissionId,
    listed: Sequence[PackageOnBoard],
    *,
    provider_id: ProviderId | None,
) -> LoadingAnswer:
    """Check whether the drone may take off with these packages; wakes `stuck`.

    Raises
    ------
    NotFound
        There is no such mission of this provider (None: of any provider).
    Conflict
        NOT_LOADING: the drone does not wait at the pickup. ALREADY_CONFIRMED, HELD, REPLANNING.
    InvalidInput
        A package is not of this mission, or is listed twice.
    """
    async with context.db.write() as tx:
        work, record = await lock_mission(context, tx, mission_id, provider_id=provider_id)
        _refuse_unless_loading(work, record)
        _refuse_unknown_packages(record, listed)
        tx.after_commit(context.stuck.set)
        fault = _loading_fault(record, listed)
        if fault is not None:
            await refuse_loading(work, record, fault)
            return LoadingAnswer(outcome="REFUSED", code=fault.code, detail=fault.detail)
        await _confirm(work, record, listed)
        return LoadingAnswer(outcome="CONFIRMED")


async def refuse_loading(
    work: MissionUnitOfWork, record: MissionRecord, fault: LoadingFault
) -> None:
    """End a mission that was not loaded as agreed, and raise an alarm."""
    await raise_alarm(
        work,
        record,
        level="WARNING",
        code=fault.code,
        detail=fault.detail,
        station_id=record.request.pickup.station_id,
        data=fault.data,
    )
    await ending.cancel(work, record, Trouble(code=fault.code, detail=fault.detail))


def _refuse_unless_loading(work: MissionUnitOfWork, record: MissionRecord) -> None:
    if record.mission.loading == "CONFIRMED" or record.is_being_loaded:
        raise Conflict("ALREADY_CONFIRMED", f"the loading of {record.mission_id} was confirmed")
    if record.mission.is_held:
        raise Conflict("HELD", f"{record.mission_id} is held by an operator")
    if record.trouble is not None and record.trouble.code == PACKAGES_CANCELLED:
        detail = f"{record.drone_id} has not received the change for the cancelled packages"
        raise Conflict("REPLANNING", detail)
    link, pickup = work.links.get(record.drone_id), record.request.pickup.station_id
    state = None if link is None else link.state
    stands_and_waits = (
        record.mission.loading == "AWAITED"
        and state is not None
        and (state.mission_id, state.activity) == (record.mission_id, "LOADING")
        and state.station_id == pickup
    )
    if not stands_and_waits:
        detail = f"{record.drone_id} does not stand at {pickup} and wait to be loaded"
        raise Conflict("NOT_LOADING", detail)


async def _confirm(
    work: MissionUnitOfWork, record: MissionRecord, listed: Sequence[PackageOnBoard]
) -> None:
    """Request a new plan with the measured masses; with it the drone takes off."""
    measured_kg = {each.package_id: each.mass_kg for each in listed}
    packages = tuple(
        each.model_copy(update={"mass_kg": measured_kg[each.package_id]})
        for each in record.request.packages
    )
    request = record.request.model_copy(update={"packages": packages})
    record = replace(record, request=request)
    await store.save_request(work.tx, record)
    trouble = Trouble(
        code="LOADED",
        detail=f"{sum(measured_kg.values()):g} kg are on board",
        loaded=tuple(
            PackageOnBoard(package_id=each.package_id, mass_kg=each.mass_kg) for each in packages
        ),
    )
    await request_plan(work, record, trouble)


def _refuse_unknown_packages(record: MissionRecord, listed: Sequence[PackageOnBoard]) -> None:
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


def _loading_fault(record: MissionRecord, listed: Sequence[PackageOnBoard]) -> LoadingFault | None:
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
