"""What people do to missions, over REST: loaders, operators, and customers through the gateway."""

from typing import Annotated, Any, Final

from fastapi import Depends, Query
from fastapi.responses import JSONResponse
from pydantic import Field

from skyway.contracts.flight_step import PackageOnBoard
from skyway.contracts.mission import Cancellation, CancelMissions, WithdrawMissions
from skyway.delivery.request import MAX_PACKAGE_MASS_KG, MAX_PACKAGES
from skyway.ids import DeliveryId, MissionId, PackageId, ProviderId
from skyway.json_model import JsonModel, QueryModel
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.context import Context
from skyway_composition.missions.interventions.cancel import cancel_packages
from skyway_composition.missions.interventions.confirm_loading import (
    LoadingAnswer,
    handle_confirmation,
)
from skyway_composition.missions.interventions.give_command import (
    Command,
    CommandAnswer,
    CommandPreview,
    give_command,
    preview_command,
)
from skyway_composition.missions.interventions.withdraw import withdraw_missions
from skyway_composition.missions.replanning.foresee import Foresight


class LoadedPackage(JsonModel):
    """A package on board, with its mass as it was measured."""

    package_id: Annotated[PackageId, Field(description="Id of the package.")]
    # Strict: true is not 1 kg.
    mass_kg: Annotated[
        float,
        Field(
            ge=0,
            le=MAX_PACKAGE_MASS_KG,
            description="Measured mass in kilograms.",
            examples=[0.4],
        ),
    ]


class Loaded(JsonModel):
    """All packages on board; a package of the mission that is not listed is missing."""

    packages: Annotated[
        tuple[LoadedPackage, ...],
        Field(max_length=MAX_PACKAGES, description="All packages on board, each once."),
    ]


class CommandDryRun(QueryModel):
    """Whether to give a command or only to preview it."""

    dry_run: Annotated[
        bool,
        Field(description="Change and send nothing; the answer says what the command would do."),
    ] = False


#: The answer to a dry run.
_PREVIEWED: Final[dict[int | str, dict[str, Any]]] = {200: {"model": CommandPreview}}


def intervention_routes(
    *, gate: ServiceGate, context: Context, foresight: Foresight
) -> ServiceRouter:
    """Loading and commands under /v1/missions, the gateway's cancellations under /internal."""
    router = ServiceRouter(tags=("missions",))

    @router.post(
        "/v1/missions/{mission_id}/loading",
        responses=conflicts(
            "ALREADY_CONFIRMED",
            "HELD",
            "MISSION_OVER",
            "MISSION_QUEUED",
            "NOT_LOADING",
            "REPLANNING",
        ),
    )
    async def confirm_loading(
        mission_id: MissionId, caller: Annotated[Caller, Depends(gate)], loaded: Loaded
    ) -> LoadingAnswer:
        """Confirm the measured masses on board; the plan is checked with them."""
        caller.must_be("provider", "operator")
        own = ProviderId(caller.subject_id) if caller.role == "provider" else None
        listed = [
            PackageOnBoard(package_id=each.package_id, mass_kg=each.mass_kg)
            for each in loaded.packages
        ]
        return await handle_confirmation(context, mission_id, listed, provider_id=own)

    @router.post(
        "/v1/missions/{mission_id}/commands",
        status_code=202,
        response_model=CommandAnswer,
        responses=_PREVIEWED
        | conflicts(
            "ALREADY_CALLED_HOME",
            "ALREADY_HELD",
            "BEING_LOADED",
            "HELD",
            "MISSION_OVER",
            "MISSION_QUEUED",
            "NOTHING_ON_BOARD",
            "NOT_HELD",
            "NOT_IN_DOUBT",
            "TOO_LATE",
        ),
    )
    async def command_mission(
        mission_id: MissionId,
        caller: Annotated[Caller, Depends(gate)],
        command: Command,
        query: Annotated[CommandDryRun, Query()],
    ) -> CommandAnswer | JSONResponse:
        """Hold a mission's drone, resume it, divert it, call it home, or cancel the mission."""
        caller.must_be("operator")
        if not query.dry_run:
            return await give_command(context, mission_id, command)
        preview = await preview_command(context, foresight, mission_id, command)
        return JSONResponse(preview.model_dump(mode="json"))

    @router.post("/internal/deliveries/{delivery_id}/cancellations")
    async def cancel_missions(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[CancelMissions, Depends(internal_body(CancelMissions))],
    ) -> Cancellation:
        """Cancel packages; loaded packages come back, and a repeated call gets the same answer."""
        caller.must_be_service("gateway")
        return await cancel_packages(context, delivery_id, requested)

    @router.post(
        "/internal/deliveries/{delivery_id}/withdrawals",
        status_code=204,
        responses=conflicts("SHARED_TRIP", "TOO_LATE"),
    )
    async def withdraw(
        delivery_id: DeliveryId,
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[WithdrawMissions, Depends(internal_body(WithdrawMissions))],
    ) -> None:
        """Give up missions that no drone has yet, because the customer changes the request."""
        caller.must_be_service("gateway")
        await withdraw_missions(context, delivery_id, requested)

    return router
