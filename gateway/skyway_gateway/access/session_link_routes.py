"""Links that log a browser in once, over REST."""

from typing import Annotated

from fastapi import Request
from pydantic import Field

from skyway.contracts.message import WallMoment
from skyway.ids import KeyId
from skyway.json_model import JsonModel
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_gateway.access.login_codes import LoginCodes
from skyway_gateway.access.routes import KeyCaller, holder_of


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


def session_link_routes(*, db: Database, codes: LoginCodes) -> ServiceRouter:
    """POST /v1/session-links."""
    router = ServiceRouter(tags=("keys",))

    @router.post("/v1/session-links", status_code=201)
    async def create_session_link(request: Request, caller: KeyCaller) -> SessionLink:
        """Make a link that logs a browser in to the console, once within ten minutes.

        The link ends with its key. A key has at most 50 links; another one ends the oldest.

        Callers: customer, provider, operator.
        """
        caller.must_be("customer", "provider", "operator")
        async with db.write() as tx:
            code, expires_wall_at = await codes.make(tx, KeyId(holder_of(request).key_id))
        return SessionLink(url=codes.url_of(code), expires_wall_at=expires_wall_at)

    return router
