"""Sessions of browsers and the links that begin them, over REST.

A session is opened with a key or a code, and shown and ended by its cookie.
"""

import secrets
from typing import Annotated, Final

from fastapi import Depends, Request, Response
from pydantic import Field

from skyway.contracts.message import WallMoment
from skyway.ids import KeyId, SubjectId, is_live_account
from skyway.json_model import JsonModel
from skyway.runtime.errors import AccessDenied, NotFound, Unauthenticated
from skyway.runtime.http.identity import Caller
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.http.session_cookie import (
    SESSION_PREFIX,
    end_session,
    require_own_page,
    session_in,
    set_session,
)
from skyway.runtime.peer_secrets import secret_hash
from skyway_gateway.access import session_store
from skyway_gateway.access.api_key import KeyRole
from skyway_gateway.access.login_codes import LoginCodes
from skyway_gateway.access.recognise import CachedKeys
from skyway_gateway.access.routes import KeyCaller, admitted, caller_with_key, holder_of
from skyway_gateway.context import Context

_SECRET_BYTES: Final = 32

_LOGIN_NEEDED: Final = (
    "a session begins with a key (Authorization: Bearer sk_...) or with the code of a login link"
)
_LINK_IS_OVER: Final = "this login link was used, has expired, or never was one: make another one"


class LoginCode(JsonModel):
    """What a login link holds behind `#login=`."""

    code: Annotated[
        str,
        Field(
            min_length=1,
            max_length=200,
            description="The code of a link of `POST /v1/session-links`; it can be used once.",
        ),
    ]


class Session(JsonModel):
    """For whom a browser's session calls, and until when at the latest."""

    role: Annotated[KeyRole, Field(description="The role of the key.")]
    subject_id: Annotated[
        SubjectId,
        Field(description="The customer's name, the provider's id or the operator's name."),
    ]
    scopes: Annotated[
        tuple[str, ...] | None,
        Field(description="What the key allows; null means everything that its role may do."),
    ]


def session_routes(context: Context, *, cached: CachedKeys, codes: LoginCodes) -> ServiceRouter:
    """POST /v1/sessions, and GET and DELETE /v1/sessions/current."""
    router = ServiceRouter(tags=("keys",))

    async def recognise_code(request: Request, code: str) -> Caller:
        try:
            await request.state.recognise_code(code, codes)
        except Unauthenticated as error:
            raise Unauthenticated(_LINK_IS_OVER) from error
        require_own_page(request)
        return admitted(request)

    # A code needs no key, which OpenAPI says by an empty alternative.
    @router.post("/v1/sessions", status_code=201, openapi_extra={"security": [{}]})
    async def create_session(
        request: Request,
        response: Response,
        caller: Annotated[Caller | None, Depends(caller_with_key)],
        login: LoginCode | None = None,
    ) -> Session:
        """Begin a session of a browser: its cookie stands for the key for twelve hours.

        It begins with a key, or without one with the code of a login link, which must come from a
        page of this gateway. The cookie is HttpOnly and SameSite=Strict, and Secure over HTTPS. A
        call with it that changes something must come from a page of this gateway. The session ends
        with its key.

        Callers: customer, provider, operator.
        """
        code = None
        if caller is None:
            if login is None:
                raise Unauthenticated(_LOGIN_NEEDED)
            code = login.code
            caller = await recognise_code(request, code)
        caller.must_be("customer", "provider", "operator")
        _must_be_live(caller)
        secret = SESSION_PREFIX + secrets.token_urlsafe(_SECRET_BYTES)
        async with context.db.write() as tx:
            if code is not None and not await codes.use(tx, code):
                raise Unauthenticated(_LINK_IS_OVER)
            await session_store.add(
                tx,
                secret_hash(secret),
                KeyId(holder_of(request).key_id),
                at=context.clock.wall_now(),
                lasts=session_store.SESSION_LASTS,
            )
        lasts_s = int(session_store.SESSION_LASTS.total_seconds())
        set_session(response, request, secret, lasts_s=lasts_s)
        return _session(request)

    @router.get("/v1/sessions/current")
    async def get_session(request: Request, caller: KeyCaller) -> Session:
        """Show for whom the browser calls.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        return _session(request)

    @router.delete("/v1/sessions/current", status_code=204)
    async def delete_session(request: Request, caller: KeyCaller) -> Response:
        """End the browser's session, and have it forget the cookie.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        secret = session_in(request)
        if secret is None:
            raise NotFound("session", "current")
        async with context.db.write() as tx:
            await session_store.end(tx, secret_hash(secret))
            tx.after_commit(cached.forget)
        response = Response(status_code=204)
        end_session(response)
        return response

    return router


def _must_be_live(caller: Caller) -> None:
    if not is_live_account(caller.subject_id):
        raise AccessDenied("test keys have no console: follow test deliveries by REST and webhooks")


def _session(request: Request) -> Session:
    holder = holder_of(request)
    scopes = None if holder.scopes is None else tuple(sorted(holder.scopes))
    return Session.model_validate(
        {
            "role": holder.caller.role,
            "subject_id": holder.caller.subject_id,
            "scopes": scopes,
        }
    )


class SessionLink(JsonModel):
    """A link that logs a browser in once."""

    url: Annotated[
        str,
        Field(
            description="Link to the console with a code behind `#login=`. The first browser that "
            "opens it gets a session of the key."
        ),
    ]
    expires_wall_at: Annotated[
        WallMoment,
        Field(description="When the link ends, wall time: ten minutes after it was made."),
    ]


def session_link_routes(context: Context, *, codes: LoginCodes) -> ServiceRouter:
    """POST /v1/session-links."""
    router = ServiceRouter(tags=("keys",))

    @router.post("/v1/session-links", status_code=201)
    async def create_session_link(request: Request, caller: KeyCaller) -> SessionLink:
        """Make a link that logs a browser in to the console, once within ten minutes.

        The link ends with its key. A key has at most 50 links; another one ends the oldest.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        _must_be_live(caller)
        async with context.db.write() as tx:
            code, expires_wall_at = await codes.make(tx, KeyId(holder_of(request).key_id))
        return SessionLink(url=codes.url_of(code), expires_wall_at=expires_wall_at)

    return router
