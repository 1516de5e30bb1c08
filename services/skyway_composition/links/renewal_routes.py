"""The registry notifies composition that the credentials of drones were renewed."""

from typing import Annotated

from fastapi import Depends, Response

from skyway.contracts.drones import RENEWALS, Renewals
from skyway.runtime.http.app import internal_body
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition.links.store import lock_links, save_last_links


def renewal_routes(*, db: Database, gate: ServiceGate) -> ServiceRouter:
    """POST /internal/renewed-credentials."""
    router = ServiceRouter(tags=("internal",))

    @router.post(RENEWALS, status_code=204)
    async def renew_credentials(
        caller: Annotated[Caller, Depends(gate)],
        requested: Annotated[Renewals, Depends(internal_body(Renewals))],
    ) -> Response:
        """Forget the numbers of messages that came with earlier credentials; it may be repeated."""
        caller.must_be_service("registry")
        at_ms = {each.drone_id: moment_to_ms(each.at) for each in requested.renewals}
        async with db.write() as tx:
            links = await lock_links(tx, at_ms)
            renewed = [link.renewed(at_ms=at_ms[drone_id]) for drone_id, link in links.items()]
            save_last_links(tx, renewed)
        return Response(status_code=204)

    return router
