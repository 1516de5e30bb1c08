"""Reads the stations of a box by REST with a drone's key, page by page, in a thread."""

import asyncio
from collections.abc import Sequence
from typing import Final
from urllib.parse import quote, urlencode

from pydantic import ValidationError

from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.enrolment.cloud import Cloud, CloudAccess, CloudRefused, CloudUnreachable
from skyway_drone_agent.landing_book.station_cache import MOST_STATIONS, CachedStation
from skyway_drone_agent.landing_book.tiles import TileBox

#: The largest page of the cloud.
_PAGE: Final = 200

_KEY_IS_REFUSED: Final = frozenset({401, 403})


class _Station(WireModel):
    station_id: StationId
    position: Position
    is_closed: bool = False


class _Stations(WireModel):
    items: tuple[_Station, ...]
    next_cursor: str | None = None


class StationReader:
    """Uses the first of the drones' keys until it is refused, then the next."""

    def __init__(self, accesses: Sequence[CloudAccess]) -> None:
        self._accesses = list(accesses)

    @property
    def may_ask(self) -> bool:
        """Whether a key is left that was not refused."""
        return bool(self._accesses)

    async def stations_in(self, box: TileBox, network_id: NetworkId) -> list[CachedStation]:
        """The current stations of a network in a box.

        Raises
        ------
        CloudUnreachable
            There was no answer, or no valid one.
        CloudRefused
            There is no such network, or no key is left.
        """
        found: list[CachedStation] = []
        cursor: str | None = None
        while len(found) < MOST_STATIONS:
            page = await self._page(box, network_id, cursor)
            found += (
                CachedStation(network_id, Landing(each.station_id, each.position), each.is_closed)
                for each in page.items
            )
            cursor = page.next_cursor
            if cursor is None:
                break
        return found

    async def _page(self, box: TileBox, network_id: NetworkId, cursor: str | None) -> _Stations:
        query = {"bbox": box.bbox, "limit": str(_PAGE)}
        if cursor is not None:
            query["cursor"] = cursor
        path = f"/v1/networks/{quote(network_id, safe='')}/stations?{urlencode(query)}"
        # One page at a time, so that the agent can stop between two pages.
        answer = await asyncio.to_thread(self._get, path)
        try:
            return _Stations.model_validate(answer)
        except ValidationError as error:
            raise CloudUnreachable(
                f"not a list of stations: {error.error_count()} errors"
            ) from error

    def _get(self, path: str) -> object:
        while True:
            access = self._accesses[0]
            try:
                return Cloud(access.api_url).get(path, key=access.key)
            except CloudRefused as error:
                if error.status not in _KEY_IS_REFUSED:
                    raise
                del self._accesses[0]
                if not self._accesses:
                    raise
