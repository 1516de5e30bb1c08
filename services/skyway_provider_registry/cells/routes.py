"""The table of cells over REST: operators change the table, gateway and composition read it."""

from typing import Annotated

from fastapi import Depends
from pydantic import Field

from skyway.contracts.cells import CELLS, CellState, CellTable, CellUrl, NetworkCell
from skyway.ids import NetworkId
from skyway.json_model import JsonModel
from skyway.runtime.http.answers import NOT_FOUND, conflicts
from skyway.runtime.http.identity import Caller, ServiceGate
from skyway.runtime.http.service_router import ServiceRouter
from skyway.runtime.sql.database import Database
from skyway_provider_registry.cells import store
from skyway_provider_registry.cells.change_cells import CellChanges


class CellPlace(JsonModel):
    """The server that serves a network."""

    url: CellUrl


class CellStateChange(JsonModel):
    """Whether a cell accepts new requests."""

    state: Annotated[CellState, Field(description="CLOSED refuses new requests with 503.")]


class CellList(JsonModel):
    """All cells."""

    items: Annotated[tuple[NetworkCell, ...], Field(description="In order of their networks.")]


def cell_routes(*, db: Database, gate: ServiceGate, changes: CellChanges) -> ServiceRouter:
    """/v1/cells, and the table for the other services."""
    router = ServiceRouter(tags=("cells",))

    @router.get(CELLS)
    async def get_cell_table(caller: Annotated[Caller, Depends(gate)]) -> CellTable:
        """The table of cells."""
        caller.must_be_service("gateway", "composition")
        may_grow = bool(changes.hosts) or db.dialect != "sqlite"
        async with db.read() as connection:
            return CellTable(cells=await store.every(connection), may_grow=may_grow)

    @router.get("/v1/cells")
    async def list_cells(caller: Annotated[Caller, Depends(gate)]) -> CellList:
        """List the networks that have a server of composition of their own."""
        caller.must_be("operator")
        async with db.read() as connection:
            return CellList(items=await store.every(connection))

    @router.put(
        "/v1/cells/{network_id}",
        responses=conflicts("CELL_EXISTS", "NETWORK_ELSEWHERE", "OTHER_VERSION", "WRONG_SERVER"),
    )
    async def put_cell(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)], place: CellPlace
    ) -> NetworkCell:
        """Let this server serve the network. A network at another server must be moved instead."""
        caller.must_be("operator")
        return await changes.add(network_id, url=place.url)

    @router.patch("/v1/cells/{network_id}", responses={**NOT_FOUND, **conflicts("CELL_SEALED")})
    async def update_cell(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)], change: CellStateChange
    ) -> NetworkCell:
        """Close a cell to new requests, or open it again. Drones finish their missions."""
        caller.must_be("operator")
        return await changes.set_state(network_id, change.state)

    @router.post(
        "/v1/cells/{network_id}/moves",
        responses={
            **NOT_FOUND,
            **conflicts(
                "CELL_BUSY",
                "CELL_CHANGED",
                "CELL_NOT_ALONE",
                "CELL_NOT_COPIED",
                "CELL_NOT_SEALED",
                "CELL_OPEN",
                "OTHER_VERSION",
                "WRONG_SERVER",
            ),
        },
    )
    async def move_cell(
        network_id: NetworkId, caller: Annotated[Caller, Depends(gate)], place: CellPlace
    ) -> NetworkCell:
        """Move the network to another server, which has a copy of the old server's database.

        The cell must be closed, and its server must have finished its work. All cells of the old
        server move together. They are open afterwards.
        """
        caller.must_be("operator")
        return await changes.move(network_id, url=place.url)

    return router
