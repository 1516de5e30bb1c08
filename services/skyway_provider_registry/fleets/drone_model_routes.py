"""Drone models over REST."""

from typing import Annotated

from fastapi import Depends, Query, Response

from skyway.drone.model import DroneAbilities, DroneModel
from skyway.errors import InvalidInput
from skyway.ids import DroneModelId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.context import Context
from skyway_provider_registry.fleets.store import every_model, put_model


class DroneModelBody(DroneAbilities):
    """A drone model; its id stands in the path, and may be repeated here."""

    model_id: DroneModelId | None = None

    def named(self, model_id: DroneModelId) -> DroneModel:
        """The model with the id of the path.

        Raises
        ------
        InvalidInput
            The body has another id.
        """
        if self.model_id not in (None, model_id):
            raise InvalidInput("model_id", f"{self.model_id!r} is not the path's {model_id!r}")
        return DroneModel(**{**dict(self), "model_id": model_id})


def drone_model_routes(context: Context) -> ServiceRouter:
    """GET /v1/drone-models, GET and PUT /v1/drone-models/{model_id}."""
    router = ServiceRouter(tags=("drone-models",))

    @router.get("/v1/drone-models")
    async def list_drone_models(
        caller: Annotated[Caller, Depends(context.gate)], query: Annotated[PageQuery, Query()]
    ) -> Page[DroneModel]:
        """List all drone models, by id."""
        after = query.after_id()
        async with context.db.read() as connection:
            models = await every_model(connection)
        rest = [one for one in models.values() if after is None or one.model_id > after]
        shown = rest[: query.limit + 1]
        return page_of(shown, query, item=lambda one: one, sort_key=lambda one: (one.model_id,))

    @router.get("/v1/drone-models/{model_id}")
    async def get_drone_model(
        model_id: DroneModelId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> DroneModel:
        """Show a drone model."""
        async with context.db.read() as connection:
            models = await every_model(connection)
        if model_id not in models:
            raise NotFound("drone model", model_id)
        return models[model_id]

    @router.put(
        "/v1/drone-models/{model_id}",
        responses={
            201: {"model": DroneModel, "description": "The model is new"},
            **conflicts("MODEL_IN_USE", "NAMED_MODEL", "OTHERS_MODEL", "TOO_MANY_MODELS"),
        },
    )
    async def put_drone_model(
        model_id: DroneModelId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: DroneModelBody,
        response: Response,
    ) -> DroneModel:
        """Add a drone model, or replace a model that no drone has.

        Everybody may register drones of it. A provider replaces only models that it added.
        """
        caller.must_be("provider", "operator")
        model = requested.named(model_id)
        async with context.db.write() as tx:
            is_new = await put_model(tx, model, caller)
        response.status_code = 201 if is_new else 200
        return model

    return router
