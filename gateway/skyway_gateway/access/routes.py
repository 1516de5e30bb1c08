"""Keys, limits and the audit log over HTTP: who the caller is, and operators' routes."""

from collections.abc import Sequence
from typing import Annotated

from fastapi import Depends, Query, Request, Response
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from skyway.ids import KeyId
from skyway.runtime.errors import Unauthenticated
from skyway.runtime.http.answers import IdempotencyKey, conflicts, keyed_call, response_of
from skyway.runtime.http.entrance import Meters
from skyway.runtime.http.identity import Caller, KeyHolder
from skyway.runtime.http.paging import Page, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway_gateway.access import audit_store, store
from skyway_gateway.access.api_key import ApiKey, IssuedKey, KeyRequest
from skyway_gateway.access.audit_store import AuditEntry, AuditQuery
from skyway_gateway.access.keys import Keys
from skyway_gateway.access.scopes import require_scope
from skyway_gateway.access.store import KeyListQuery
from skyway_gateway.access.usage import Limits, UsageBudget, UsageCounter
from skyway_gateway.context import Context

_bearer = HTTPBearer(auto_error=False, description="an API key: sk_..., or a drone's: dk_...")


async def caller_of_key(
    request: Request, _shown: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> Caller:
    """The caller whose key is shown, if the key has the scope of this call."""
    return admitted(request)


#: The caller of a route that needs a key.
KeyCaller = Annotated[Caller, Depends(caller_of_key)]


async def caller_with_key(
    request: Request, _shown: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> Caller | None:
    """The caller whose key is shown, if the key has the scope of this call; None without a key.

    A dependency for calls whose body may hold a code instead of a key.
    """
    return admitted(request) if "Authorization" in request.headers else None


def admitted(request: Request) -> Caller:
    """The caller whom the entrance has recognised, if their key has the scope of this call.

    Raises
    ------
    Unauthenticated
        No key was shown.
    ScopeMissing
        The key does not allow this call.
    """
    holder = holder_of(request)
    require_scope(holder, f"{request.method} {request.scope['route'].path}")
    return holder.caller


def holder_of(request: Request) -> KeyHolder:
    """The holder of the key that the entrance has recognised.

    Raises
    ------
    Unauthenticated
        No key was shown.
    """
    holder = getattr(request.state, "holder", None)
    if not isinstance(holder, KeyHolder):
        raise Unauthenticated
    return holder


def key_routes(context: Context, *, keys: Keys) -> ServiceRouter:
    """GET, POST and DELETE /v1/keys for customers and operators, and POST /v1/keys/rotations."""
    router = ServiceRouter(tags=("keys",))

    @router.post(
        "/v1/keys",
        status_code=201,
        response_model=IssuedKey,
        responses=conflicts("TOO_MANY_KEYS"),
    )
    async def create_key(
        request: Request,
        caller: KeyCaller,
        requested: KeyRequest,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Make an API key; its secrets are shown only in this answer.

        A key can give no more scopes and no later end than its own. Customers make keys of their
        own test account, with `livemode` false.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        call = await keyed_call(request, caller, idempotency_key)
        return response_of(await keys.issue(holder_of(request), requested, call))

    @router.post("/v1/keys/rotations", status_code=201, response_model=IssuedKey)
    async def rotate_key(
        request: Request,
        caller: KeyCaller,
        idempotency_key: IdempotencyKey = None,
    ) -> Response:
        """Get the next key of the key that is shown, with the same name, scopes and expiry.

        The present key ends when the next one is first used, at the latest after a day. If the
        broker login came with the present key, it gets a new password now.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        holder = holder_of(request)
        # The answer belongs to this key: another key of the caller must not get it.
        call = await keyed_call(request, f"{caller}:{holder.key_id}", idempotency_key)
        return response_of(await keys.rotate(holder, call))

    @router.get("/v1/keys")
    async def list_keys(caller: KeyCaller, query: Annotated[KeyListQuery, Query()]) -> Page[ApiKey]:
        """List keys in use, without their secrets: a customer's own and its test keys, or all.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            found = await store.page(connection, caller, query, at=context.clock.wall_now())
        return page_of(found, query, item=lambda key: key, sort_key=lambda key: (key.key_id,))

    @router.get("/v1/keys/{key_id}")
    async def get_key(key_id: KeyId, caller: KeyCaller) -> ApiKey:
        """Show a key, without its secret.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        async with context.db.read() as connection:
            return await store.one(connection, caller, key_id, at=context.clock.wall_now())

    @router.delete("/v1/keys/{key_id}", status_code=204)
    async def delete_key(key_id: KeyId, caller: KeyCaller) -> Response:
        """Delete a key; calls with it are refused from now on. Customers delete test keys.

        Callers: customer, operator.
        """
        caller.must_be("customer", "operator")
        await keys.delete(caller, key_id)
        return Response(status_code=204)

    return router


def audit_routes(context: Context) -> ServiceRouter:
    """GET /v1/audit."""
    router = ServiceRouter(tags=("audit",))

    @router.get("/v1/audit")
    async def list_audit_entries(
        caller: KeyCaller, query: Annotated[AuditQuery, Query()]
    ) -> Page[AuditEntry]:
        """List what operators and providers changed, and refused keys, the newest first.

        Callers: operator.
        """
        caller.must_be("operator")
        async with context.db.survey() as connection:
            found = await audit_store.page(connection, query)
        return page_of(found, query, item=lambda it: it, sort_key=lambda it: (it.entry_id,))

    return router


def limit_routes(*, meters: Meters, counters: Sequence[UsageCounter]) -> ServiceRouter:
    """GET /v1/limits."""
    router = ServiceRouter(tags=("limits",))

    @router.get("/v1/limits")
    async def show_limits(caller: KeyCaller) -> Limits:
        """Show what the caller may use, and what is left of it.

        Callers: every API key.
        """
        budgets = [UsageBudget.of(meter.read(str(caller))) for meter in meters.of(caller)]
        quotas = [quota for each in counters for quota in await each.usage(caller)]
        return Limits(budgets=tuple(budgets), quotas=tuple(quotas))

    return router
