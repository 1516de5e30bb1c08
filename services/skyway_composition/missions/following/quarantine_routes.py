"""The quarantine over REST: operators look at set-aside messages, replay and delete them."""

from typing import Annotated

from fastapi import Depends, Query, Response
from pydantic import Field

from skyway.ids import ProviderId, QuarantineId
from skyway.runtime.errors import NotFound
from skyway.runtime.http.answers import conflicts
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.paging import Page, PageQuery, page_of
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_composition.missions.following.replay import Replays
from skyway_composition.quarantine import store
from skyway_composition.quarantine.quarantined import QuarantinedMessage


class QuarantineQuery(PageQuery):
    """The set-aside messages that a list shows."""

    provider_id: Annotated[
        ProviderId | None,
        Field(description="Only messages under this provider's name; all without it."),
    ] = None


def quarantine_routes(*, db: Database, gate: ServiceGate, replays: Replays) -> ServiceRouter:
    """GET and DELETE /v1/quarantine, and POST /v1/quarantine/{quarantine_id}/replay."""
    router = ServiceRouter(tags=("quarantine",))

    @router.get("/v1/quarantine")
    async def list_quarantine(
        caller: Annotated[Caller, Depends(gate)], query: Annotated[QuarantineQuery, Query()]
    ) -> Page[QuarantinedMessage]:
        """List the messages of drones that were not accepted, the newest first."""
        caller.must_be("operator")
        async with db.read() as connection:
            rows = await store.page(
                connection,
                provider_id=query.provider_id,
                before=query.after_id(),
                limit=query.limit + 1,
            )
        return page_of(
            rows, query, item=lambda each: each, sort_key=lambda each: (each.quarantine_id,)
        )

    @router.post(
        "/v1/quarantine/{quarantine_id}/replay",
        status_code=204,
        responses=conflicts("PAYLOAD_CUT", "STILL_NOT_TAKEN"),
    )
    async def replay_quarantined_message(
        quarantine_id: QuarantineId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Handle a set-aside message now; it leaves the quarantine when it is accepted."""
        caller.must_be("operator")
        await replays.replay(quarantine_id)
        return Response(status_code=204)

    @router.delete("/v1/quarantine/{quarantine_id}", status_code=204)
    async def delete_quarantined_message(
        quarantine_id: QuarantineId, caller: Annotated[Caller, Depends(gate)]
    ) -> Response:
        """Delete a set-aside message; it was never accepted."""
        caller.must_be("operator")
        async with db.write() as tx:
            is_gone = await store.remove(tx, quarantine_id)
        if not is_gone:
            raise NotFound("quarantined message", quarantine_id)
        return Response(status_code=204)

    return router
