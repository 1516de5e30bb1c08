"""The compositions of networks, as the setting `SKYWAY_CELLS` names them.

A cell is a composition with a database of its own. The composition of `SKYWAY_COMPOSITION_URL`
serves all networks that the setting does not name.
"""

import asyncio
import re
from collections.abc import Awaitable, Callable, Collection, Mapping
from contextlib import AsyncExitStack
from dataclasses import dataclass
from typing import Annotated, Final, Generic, Self, TypeVar

from pydantic import Field, field_validator
from pydantic_settings import NoDecode

from skyway.ids import NetworkId
from skyway.runtime.errors import ServiceUnavailable
from skyway.runtime.http.client import ServiceClient
from skyway.runtime.settings import ServiceSettings

AnswerT = TypeVar("AnswerT")

#: Names the network of a request, so that a composition can refuse the networks of others.
NETWORK_HEADER: Final = "Skyway-Network"

#: A network, and the address of its composition without a slash at the end.
_CELL: Final = re.compile(r"([A-Za-z0-9_-]{1,64})=(https?://[^\s?#/@]+(?:/[^\s?#/]+)*)")

#: The server of all networks without a cell.
DEFAULT_SERVER: Final = "composition"

#: The longest wait for each server when all servers are asked, wall seconds.
ANSWERS_WITHIN_S: Final = 3.0


class CellSettings(ServiceSettings):
    """`ServiceSettings`, and which composition serves which network."""

    cells: Annotated[dict[NetworkId, str], NoDecode] = Field(
        default={},
        description="`NETWORK=URL`, separated by commas: networks with a composition of their own. "
        "That of `SKYWAY_COMPOSITION_URL` serves all others. Set it the same for gateway, registry "
        "and each composition.",
    )

    @field_validator("cells", mode="before")
    @classmethod
    def _read_cells(cls, value: object) -> object:
        """Each network with the address of its composition."""
        if not isinstance(value, str):
            return value
        cells: dict[str, str] = {}
        for part in filter(None, map(str.strip, value.split(","))):
            found = _CELL.fullmatch(part)
            if found is None:
                raise ValueError(f"{part} must look like texas=http://composition-texas:8002")
            network_id, url = found.groups()
            if cells.setdefault(network_id, url) != url:
                raise ValueError(f"{network_id} has two addresses: {cells[network_id]} and {url}")
        return cells


class CellClients:
    """The clients of all servers of composition; `closed` networks accept no new requests."""

    def __init__(
        self,
        default: ServiceClient,
        cells: Mapping[NetworkId, str],
        closed: Collection[NetworkId] = (),
    ) -> None:
        self.cells, self.default, self._closed = cells, default, closed
        self._opened = AsyncExitStack()
        self._by_url = {default.url: default}
        for url in cells.values():
            served = ", ".join(each for each, its_url in cells.items() if its_url == url)
            self._by_url.setdefault(url, default.at(url, name=f"the cell {served}"))

    async def __aenter__(self) -> Self:
        """Open all clients; nothing is connected yet."""
        for client in self._by_url.values():
            await self._opened.enter_async_context(client)
        return self

    async def __aexit__(self, *_: object) -> None:
        """Close all clients."""
        await self._opened.aclose()

    @property
    def needs_networks(self) -> bool:
        """Whether it matters of which network a request is."""
        return bool(self.cells or self._closed)

    def url_of(self, network_id: NetworkId | None) -> str:
        """The address of the server of a network; the default server's if the network is None."""
        present = self.default.url
        return present if network_id is None else self.cells.get(network_id, present)

    def of(self, network_id: NetworkId | None) -> ServiceClient:
        """The server of a network; requests to it name the network."""
        if network_id is None or not self.cells:
            return self.default
        return self._by_url[self.url_of(network_id)].adding({NETWORK_HEADER: network_id})

    def open_for(self, network_id: NetworkId | None) -> ServiceClient:
        """The server of a network, for a new request.

        Raises
        ------
        ServiceUnavailable
            The network is closed to new requests.
        """
        if network_id in self._closed:
            detail = "it is closed to new requests (SKYWAY_CLOSED_NETWORKS)"
            raise ServiceUnavailable(f"the network {network_id}", detail)
        return self.of(network_id)

    def every(self) -> Mapping[str, ServiceClient]:
        """Each server once, by a name that says which networks it serves."""
        return {client.name: client for client in self._by_url.values()}


@dataclass(frozen=True, slots=True)
class Answers(Generic[AnswerT]):
    """The answers of servers, by the servers' names, and the servers that gave no answer."""

    given: Mapping[str, AnswerT]
    silent: Mapping[str, ServiceUnavailable]

    def must_be_whole(self) -> None:
        """Go on only if every server has answered; else the error names one that has not."""
        for error in self.silent.values():
            raise error


async def ask_all(
    clients: Mapping[str, ServiceClient],
    ask: Callable[[ServiceClient], Awaitable[AnswerT]],
    *,
    within_s: float = ANSWERS_WITHIN_S,
) -> Answers[AnswerT]:
    """The answers of all servers, which are asked in parallel.

    Raises
    ------
    RemoteProblem
        A server answers with an error.
    """

    async def one(client: ServiceClient) -> AnswerT | ServiceUnavailable:
        try:
            async with asyncio.timeout(within_s):
                return await ask(client)
        except TimeoutError:
            return ServiceUnavailable(client.name, "it did not answer in time")
        except ServiceUnavailable as error:
            return error

    answers = dict(zip(clients, await asyncio.gather(*map(one, clients.values())), strict=True))
    silent = {n: each for n, each in answers.items() if isinstance(each, ServiceUnavailable)}
    given = {n: e for n, e in answers.items() if not isinstance(e, ServiceUnavailable)}
    return Answers(given, silent)
