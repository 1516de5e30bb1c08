"""Passes public calls on to the service that answers them, with the caller's identity."""

import json
from collections.abc import Awaitable, Callable, Coroutine
from http import HTTPStatus
from typing import Any, Final, Protocol

from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from skyway.ids import ProviderId, is_live_account
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import IdempotencyKey, keyed_call, response_of
from skyway.runtime.http.body_bounds import BodyLimit
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.http.client_disconnect import cancel_on_disconnect, refuse_gone
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter, takes_bytes
from skyway.runtime.idempotency_store import Answer, once
from skyway.runtime.limits import FairQueue
from skyway.runtime.sql.database import Tx
from skyway_gateway.access.api_key import NewKey
from skyway_gateway.access.keys import Keys
from skyway_gateway.access.routes import KeyCaller, holder_of
from skyway_gateway.context import Context
from skyway_gateway.forward.cell_routes import ForwardToCells, whole_body
from skyway_gateway.forward.document import most_body_bytes, stored_document
from skyway_gateway.forward.sandbox_answers import sandbox_answer
from skyway_gateway.forward.table import (
    FORWARDED,
    PROVIDER_CREATION,
    Forwarded,
    TenantLimit,
)

_PROVIDERS = "/v1/providers"

#: Values of `dry_run` that composition reads as false.
_FALSE: Final = ("false", "False", "0", "no", "off", "n", "f")


#: Passes a call on to the service that answers it.
PassOn = Callable[[Request, Forwarded, Caller | None], Coroutine[Any, Any, Response]]


class Changes(Protocol):
    """Notes what may help requests that wait for a drone."""

    def note_change(self) -> None:
        """Note a change that may help requests of any network."""
        ...


def forward_routes(
    *,
    registry: ServiceClient,
    to_cells: ForwardToCells,
    changes: Changes,
    meters: Meters,
    planning: FairQueue,
    reporting: FairQueue,
    tenant_limit: TenantLimit,
) -> ServiceRouter:
    """Every row of the table; `changes` notes each call that may have changed something.

    A closure that is lifted, or a drone that is added, may help requests that wait. Bodies of
    customers and providers have the limit of tenants.
    """
    router, document = ServiceRouter(), stored_document()

    async def pass_on(request: Request, row: Forwarded, caller: Caller | None) -> Response:
        if row.service == "composition":
            return await to_cells(request, row, caller)
        path = request.scope["path"]
        return await registry.forward(request, path, caller, timeout_s=row.timeout_s)

    for row in FORWARDED:
        takes = takes_bytes(_body_limit(most_body_bytes(row, document), tenant_limit))
        router.add_api_route(
            row.path,
            takes(_handler(row, pass_on, changes, meters, planning, reporting)),
            methods=[row.method],
            response_class=StreamingResponse,
            # The whole document takes its operation from the service's own.
            include_in_schema=False,
        )
    return router


def _body_limit(most_bytes: int, tenant_limit: TenantLimit) -> BodyLimit:
    return lambda request: tenant_limit.of(getattr(request.state, "caller", None), most_bytes)


def _handler(
    row: Forwarded,
    send: PassOn,
    changes: Changes,
    meters: Meters,
    planning: FairQueue,
    reporting: FairQueue,
) -> Callable[..., Awaitable[Response]]:
    async def pass_on(request: Request, caller: Caller | None) -> Response:
        answer = await cancel_on_disconnect(request, lambda read: send(read, row, caller))
        is_change = row.method != "GET" and not _is_dry_run(row, request)
        if is_change and answer.status_code < HTTPStatus.BAD_REQUEST:
            changes.note_change()
        return answer

    async def for_caller(request: Request, caller: KeyCaller) -> Response:
        caller.must_be(*row.roles)
        if not is_live_account(caller.subject_id):
            body, kind = sandbox_answer(f"{row.method} {row.path}", request.path_params)
            return Response(body, media_type=kind)
        _refuse_foreign(caller, request)
        queue = reporting if row.is_report else None
        if row.is_planning or _is_dry_run(row, request):
            queue = planning
        if queue is None:
            return await pass_on(request, caller)
        async with queue.turn(str(caller)):
            refuse_gone(request)
            return await pass_on(request, caller)

    async def for_anybody(request: Request) -> Response:
        answer = await pass_on(request, None)
        if answer.status_code >= HTTPStatus.BAD_REQUEST:
            meters.charge_refused(request)
        return answer

    return for_caller if row.roles else for_anybody


def provider_routes(context: Context, *, registry: ServiceClient, keys: Keys) -> ServiceRouter:
    """POST /v1/providers: forwarded, then `access` adds the provider's key."""
    # The whole document takes the operation from the registry's own.
    router = ServiceRouter(include_in_schema=False)

    @router.post(_PROVIDERS, status_code=201)
    @takes_bytes(most_body_bytes(PROVIDER_CREATION, stored_document()))
    async def create_provider(
        request: Request,
        caller: KeyCaller,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Register a provider; the answer also holds `key_id` and `key`, shown only here."""
        caller.must_be("operator")
        holder = holder_of(request)
        # A key with limits gets a key with its own limits, not one that another key made.
        asked_by = f"{caller}:{holder.key_id}" if holder.is_limited else caller
        call = await keyed_call(request, asked_by, idempotency_key)
        made = await registry.forward(request, _PROVIDERS, caller)
        if made.status_code != HTTPStatus.CREATED:
            return made
        provider = json.loads(await whole_body(made))

        async def add_key(tx: Tx) -> Answer:
            new = NewKey.of_provider(ProviderId(provider["provider_id"]), holder)
            issued = await keys.add(tx, new)
            answer = {**provider, "key_id": issued.key_id, "key": issued.key}
            location = {"Location": f"{_PROVIDERS}/{provider['provider_id']}"}
            return Answer(201, json.dumps(answer).encode(), location)

        # The registry answers the same call the same; so does this, with the same key.
        return response_of(await once(context.db, call, act=add_key, clock=context.clock))

    return router


def _is_dry_run(row: Forwarded, request: Request) -> bool:
    """Whether the call only asks what it would do, which takes a plan to answer."""
    return row.has_dry_run and request.query_params.get("dry_run", "false") not in _FALSE


def _refuse_foreign(caller: Caller, request: Request) -> None:
    """A provider's own only; not theirs looks like not there."""
    provider_id = request.path_params.get("provider_id")
    if caller.role == "provider" and provider_id not in (None, caller.subject_id):
        raise NotFound("provider", str(provider_id))
