"""Cells: which server of composition serves which network.

The registry keeps the table of cells. Gateway and composition read it every second,
or every ten seconds where it has no cell and cannot get one. The composition
of `SKYWAY_COMPOSITION_URL` serves each network that is not in the table.
"""

import re
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final, Literal, Self

from pydantic import Field

from skyway.errors import InvalidInput
from skyway.ids import NetworkId
from skyway.json_model import JsonModel, WireModel

#: Where the registry answers with the table.
CELLS: Final = "/internal/cells"

#: Where a server of composition answers with its data and its unfinished work.
CELL_WORK: Final = "/internal/cell-work"

#: Names the network of a request, and the generation of the network's row that the sender read.
CELL_HEADER: Final = "Skyway-Cell"

#: A closed cell accepts no new requests. Its drones finish their missions.
CellState = Literal["OPEN", "CLOSED"]

CellUrl = Annotated[
    str,
    Field(
        max_length=500,
        pattern=r"^https?://[^\s?#/]+(/[^\s?#/]+)*$",
        description="Address of the composition that serves the network, without a slash at the "
        "end.",
        examples=["http://composition-texas:8002"],
    ),
]


class NetworkCell(JsonModel):
    """A network with a server of composition of its own."""

    network_id: Annotated[NetworkId, Field(description="Network that the cell serves.")]
    url: CellUrl
    state: Annotated[
        CellState,
        Field(description="OPEN accepts new requests. CLOSED only finishes the work it has."),
    ]
    generation: Annotated[
        int, Field(ge=1, description="Grows with each change of the table of cells.")
    ]
    closed_at: Annotated[
        datetime | None,
        Field(description="When the cell was closed, wall time; null while the cell is open."),
    ] = None

    @property
    def header(self) -> str:
        """The value of `CELL_HEADER` in requests that follow this row."""
        return f"{self.network_id};{self.generation}"


class CellTable(WireModel):
    """All cells, in order of their networks."""

    cells: tuple[NetworkCell, ...]
    may_grow: Annotated[
        bool,
        Field(
            description="False: there is one registry, on SQLite, and its settings allow no host "
            "for a cell. Then the table need not be read every second."
        ),
    ] = True


_HEADER: Final = re.compile(r"([A-Za-z0-9_-]{1,64});([0-9]{1,18})")


@dataclass(frozen=True, slots=True)
class NamedCell:
    """What a request says in `CELL_HEADER`."""

    network_id: NetworkId
    generation: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """The network and the generation in the header.

        Raises
        ------
        InvalidInput
            The text is not ``network;generation``.
        """
        found = _HEADER.fullmatch(text)
        if found is None:
            raise InvalidInput(CELL_HEADER, "must be network;generation")
        return cls(NetworkId(found[1]), int(found[2]))


class CellWork(WireModel):
    """The data and the unfinished work of a server, for the move of its cells to another server."""

    cell_url: Annotated[str | None, Field(description="The server's SKYWAY_CELL_URL.")]
    network_ids: Annotated[
        tuple[NetworkId, ...], Field(description="The networks in its database.")
    ]
    open_missions: Annotated[int, Field(description="Missions that are not over.")]
    held_offers: Annotated[int, Field(description="Quotes and offers that hold drones or pads.")]
    unsent: Annotated[int, Field(description="Messages that wait to be sent.")]
    rows: Annotated[
        dict[str, int], Field(description="Number of rows of each table that a move copies.")
    ]
    revision: Annotated[
        str | None, Field(description="Newest migration of its database; null from older servers.")
    ] = None
    seal_id: Annotated[
        str | None, Field(description="The seal of its database, which refuses all changes.")
    ] = None
    copied_seal_id: Annotated[
        str | None, Field(description="The seal of the database of which its own is a copy.")
    ] = None
