"""POST /v1/compositions: pure planning, with no side effect."""

import asyncio
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError

from skyway.delivery.plan import Plan
from skyway.planner.airspace import Airspace
from skyway.planner.problem import Problem
from skyway.runtime.http_app import read_json
from skyway.runtime.identity import Caller, ServiceGate
from skyway_composition.planning.known_network import KnownNetworks, NetworkReference
from skyway_composition.planning.solver_pool import SolverPool

#: The most bytes of a problem with its network (decisions.md).
COMPOSITION_LIMIT_BYTES: Final = 256 * 1024 * 1024

_PROBLEM_BODY: Final[dict[str, Any]] = {  # a part of the OpenAPI document
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {
                    "type": "object",
                    "description": "a problem of planner.md; `network` is GeoJSON, or "
                    "{network_id, version} of a published one",
                    "required": ["network", "drone", "source", "packages"],
                }
            }
        },
    }
}


def composition_routes(*, gate: ServiceGate, known: KnownNetworks, solver: SolverPool) -> APIRouter:
    """POST /v1/compositions."""
    router = APIRouter(tags=["compositions"])

    @router.post("/v1/compositions", response_model=Plan, openapi_extra=_PROBLEM_BODY)
    async def compose(request: Request, caller: Annotated[Caller, Depends(gate)]) -> Plan:
        """The plan for a problem; that there is none is an answer too."""
        caller.must_be("customer", "provider", "operator", "service")
        document = await read_json(request)
        try:
            problem, airspace = await _problem(document, known)
        except ValidationError as error:
            raise _complaint(error, document) from error
        return await solver.compose(problem, airspace=airspace)

    return router


async def _problem(document: Any, known: KnownNetworks) -> tuple[Problem, Airspace | None]:
    """The problem in any JSON value, with what is known of the network that it refers to."""
    if not isinstance(document, dict):
        return await asyncio.to_thread(Problem.model_validate, document), None
    network = document.get("network")
    if isinstance(network, dict) and "network_id" in network:
        reference = NetworkReference.of(network)
        return await known.problem(document, reference)
    return await asyncio.to_thread(Problem.model_validate, document), None


def _complaint(error: ValidationError, document: Any) -> RequestValidationError:
    located = [
        {**fault, "loc": ("body", *fault["loc"])}
        for fault in error.errors(include_url=False, include_input=False)
    ]
    return RequestValidationError(located, body=document)
