"""Drone models over REST."""

from collections.abc import Mapping
from typing import Annotated

from fastapi import Depends, Query, Response
from pydantic import Field

from skyway.drone.model import DroneAbilities, DroneModel
from skyway.errors import InvalidInput
from skyway.ids import DroneModelId, ProviderId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_provider_registry.context import Context
from skyway_provider_registry.fleets.store import every_model, model_owners, put_model


class DroneModelBody(DroneAbilities):
    """A drone model; what an answer says about its id and its owner may be repeated here."""

    model_id: DroneModelId | None = None
    provider_id: Annotated[
        ProviderId | None,
        Field(description="The provider that it belongs to now; may be left out."),
    ] = None

    def named(self, model_id: DroneModelId) -> DroneModel:
        """The model with the id of the path.

        Raises
        ------
        InvalidInput
            The body has another id.
        """
        if self.model_id not in (None, model_id):
            raise InvalidInput("model_id", f"{self.model_id!r} is not the path's {model_id!r}")
        abilities = {name: value for name, value in self if name != "provider_id"}
        return DroneModel(**{**abilities, "model_id": model_id})


class ListedModel(DroneModel):
    """A drone model, and who may use it."""

    provider_id: Annotated[
        ProviderId | None,
        Field(
            description="The provider that alone may use it; null: it is in the catalogue, and "
            "every provider may."
        ),
    ]


def _listed(model: DroneModel, owners: Mapping[DroneModelId, ProviderId]) -> ListedModel:
    return ListedModel(**dict(model), provider_id=owners.get(model.model_id))


def drone_model_routes(context: Context) -> ServiceRouter:
    """GET /v1/drone-models, GET and PUT /v1/drone-models/{model_id}."""
    router = ServiceRouter(tags=("drone-models",))

    @router.get("/v1/drone-models")
    async def list_drone_models(
        caller: Annotated[Caller, Depends(context.gate)], query: Annotated[PageQuery, Query()]
    ) -> Page[ListedModel]:
        """List all drone models, by id."""
        after = query.after_id()
        async with context.db.read() as connection:
            models, owners = await every_model(connection), await model_owners(connection)
        rest = [one for one in models.values() if after is None or one.model_id > after]
        shown = rest[: query.limit + 1]
        return page_of(
            shown,
            query,
            item=lambda one: _listed(one, owners),
            sort_key=lambda one: (one.model_id,),
        )

    @router.get("/v1/drone-models/{model_id}")
    async def get_drone_model(
        model_id: DroneModelId, caller: Annotated[Caller, Depends(context.gate)]
    ) -> ListedModel:
        """Show a drone model."""
        async with context.db.read() as connection:
            models, owners = await every_model(connection), await model_owners(connection)
        if model_id not in models:
            raise NotFound("drone model", model_id)
        return _listed(models[model_id], owners)

    @router.put(
        "/v1/drone-models/{model_id}",
        responses={
            201: {"model": ListedModel, "description": "The model is new"},
            **conflicts("MODEL_IN_USE", "NAMED_MODEL", "OTHERS_MODEL", "TOO_MANY_MODELS"),
        },
    )
    async def put_drone_model(
        model_id: DroneModelId,
        caller: Annotated[Caller, Depends(context.gate)],
        requested: DroneModelBody,
        response: Response,
    ) -> ListedModel:
        """Add a drone model, or replace a model that no drone has.

        A provider's model is for its own drones, and it replaces only its own. An operator's is in
        the catalogue for all. An operator that sends a provider's model approves it for the
        catalogue.
        """
        caller.must_be("provider", "operator")
        model = requested.named(model_id)
        async with context.db.write() as tx:
            owner = (await model_owners(tx.connection)).get(model_id)
            is_new = await put_model(tx, model, caller)
            owners = await model_owners(tx.connection)
            if requested.provider_id not in (None, owner, owners.get(model_id)):
                raise InvalidInput("provider_id", f"the model belongs to {owner or 'no provider'}")
        response.status_code = 201 if is_new else 200
        return _listed(model, owners)

    return router
