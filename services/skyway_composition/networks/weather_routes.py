"""/v1/networks/{network_id}/weather: the forecast that the plans of a network use."""

import asyncio
from typing import Annotated, Final

from fastapi import Depends, Request
from pydantic import ValidationError

from skyway.complaints import fault_of
from skyway.contracts.weather import ForecastDocument, WeatherInForce
from skyway.errors import InvalidInput
from skyway.ids import NetworkId
from skyway.runtime.http.answers import NOT_FOUND
from skyway.runtime.http.app import read_json, takes_bytes
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.openapi_document import body_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_composition.networks.change_weather import WeatherChanges

#: The most bytes of a forecast (docs/reference/rest.md).
FORECAST_LIMIT_BYTES: Final = 16 * 1024 * 1024


def weather_routes(*, gate: ServiceGate, changes: WeatherChanges) -> ServiceRouter:
    """PUT, GET and DELETE of a network's forecast."""
    router = ServiceRouter(tags=("networks",))
    path = "/v1/networks/{network_id}/weather"

    @router.put(
        path,
        response_model=WeatherInForce,
        responses=NOT_FOUND,
        openapi_extra=body_of(ForecastDocument),
    )
    @takes_bytes(FORECAST_LIMIT_BYTES)
    async def put_network_weather(
        network_id: NetworkId, request: Request, caller: Annotated[Caller, Depends(gate)]
    ) -> WeatherInForce:
        """Replace the weather forecast of the network; the same content changes nothing."""
        caller.must_be("operator")
        document = await read_json(request)
        return await changes.put(network_id, await asyncio.to_thread(_read, document))

    @router.get(path, responses=NOT_FOUND)
    async def get_network_weather(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)]
    ) -> WeatherInForce:
        """Show the weather forecast of the network, and how old it is."""
        caller.must_be("customer", "provider", "operator", "service")
        return await changes.in_force(network_id)

    @router.delete(path, status_code=204)
    async def delete_network_weather(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)]
    ) -> None:
        """Remove the weather forecast of the network: plans assume still air again."""
        caller.must_be("operator")
        await changes.remove(network_id)

    return router


def _read(document: object) -> ForecastDocument:
    try:
        return ForecastDocument.model_validate(document)
    except ValidationError as error:
        field, detail = fault_of(error.errors(include_url=False, include_input=False)[0])
        raise InvalidInput(field or "forecast", detail) from error
