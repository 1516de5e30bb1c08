"""Checks that requests are for own networks, and reports the server's work before a move."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Final

from fastapi import Depends, Request

from skyway.contracts.cells import CELL_HEADER, CELL_WORK, CellWork, NamedCell
from skyway.ids import NetworkId
from skyway.runtime.clock import FleetClock
from skyway.runtime.http.entrance import ServiceEntrance
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway.units import moment_to_ms
from skyway_composition import cell_store
from skyway_composition.own_cells import OwnCells
from skyway_composition.seal_store import seal_id

#: The calls that begin something new, by method and the beginning and end of their path.
_BEGINNINGS: Final = (
    ("POST", "/internal/quotes", ""),
    ("POST", "/internal/offers", ""),
    ("PUT", "/internal/deliveries/", "/missions"),
)


_NETWORK: Final = re.compile(r"/v1/networks/([^/]+)")


@dataclass(frozen=True, slots=True)
class CellEntrance:
    """Admits requests of other services if they are for this server's own networks."""

    entrance: ServiceEntrance
    own: OwnCells

    async def __call__(self, request: Request) -> Mapping[str, str]:
        """Check the service's secret, and the network that the request names."""
        headers = await self.entrance(request)
        path: str = request.scope["path"]
        if (text := request.headers.get(CELL_HEADER)) is not None:
            begins = any(
                request.method == method and path.startswith(first) and path.endswith(last)
                for method, first, last in _BEGINNINGS
            )
            await self.own.refuse_misdirected(NamedCell.parse(text), begins=begins)
            return headers
        if path.startswith(("/v1/", "/internal/")) and path != CELL_WORK:
            self.own.refuse_when_retired()
        if request.method == "PUT" and (published := _NETWORK.fullmatch(path)):
            # The sender may not know yet that the network has a cell.
            self.own.refuse_foreign(NetworkId(published[1]))
        return headers


def cell_routes(
    *, db: Database, gate: ServiceGate, clock: FleetClock, own: OwnCells
) -> ServiceRouter:
    """GET /internal/cell-work."""
    router = ServiceRouter(tags=("internal",))

    @router.get(CELL_WORK)
    async def get_cell_work(caller: Annotated[Caller, Depends(gate)]) -> CellWork:
        """The data of this server, and the work that it has not finished."""
        caller.must_be_service("registry")
        async with db.read() as connection:
            return CellWork(
                cell_url=own.url,
                network_ids=await cell_store.network_ids(connection),
                open_missions=await cell_store.open_missions(connection),
                held_offers=await cell_store.held_offers(
                    connection, at_ms=moment_to_ms(clock.now())
                ),
                unsent=await cell_store.unsent_messages(connection),
                rows=await cell_store.rows(connection),
                revision=await cell_store.revision(connection),
                seal_id=await seal_id(connection, "SEALED"),
                copied_seal_id=await seal_id(connection, "COPIED"),
            )

    return router
