"""The landing book: one for all drones of a process, with stations read from the cloud.

Drones never wait for the book. Without the network's version, a key or an answer they fly with the
stations read so far. New stations also count for flights under way.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote, urlencode

from pydantic import ValidationError

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.world import NetworkVersion
from skyway.geo import Position
from skyway.ids import NetworkId, StationId
from skyway.json_model import WireModel
from skyway_drone_agent.analysis.landings import Landing
from skyway_drone_agent.enrolment.cloud import Cloud, CloudAccess, CloudRefused, CloudUnreachable
from skyway_drone_agent.landing_book.station_cache import (
    MOST_STATIONS,
    CachedStation,
    StationCacheFile,
    Surroundings,
)
from skyway_drone_agent.landing_book.tiles import TileBox

log = logging.getLogger(__name__)

#: Wall seconds after which surroundings are read again when a drone asks: stations close and open.
_GOOD_FOR_S: Final = 600.0

#: Number of surroundings that are kept, and read again when the network changes.
_MOST_SURROUNDINGS: Final = 4_096

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


#: Wall seconds before a failed read is repeated, and between two writes of the file.
_AGAIN_AFTER_S, _WRITE_EVERY_S = 30.0, 60.0


@dataclass(frozen=True, slots=True)
class _Version:
    """A network's content, and when its version was first noted."""

    sha256: str
    noted_at_s: float


class LandingBook:
    """Provides the surroundings of flights, and reads them from the cloud one by one."""

    def __init__(
        self,
        reader: StationReader,
        file: StationCacheFile,
        *,
        good_for_s: float = _GOOD_FOR_S,
        again_after_s: float = _AGAIN_AFTER_S,
    ) -> None:
        self._reader = reader
        self._file = file
        self._good_for_s = good_for_s
        self._again_after_s = again_after_s
        self._cache = file.read()
        self._networks: dict[NetworkId, _Version] = {}
        self._surroundings: dict[TileBox, Surroundings] = {}
        self._requested: dict[TileBox, None] = {}
        self._has_news = asyncio.Event()
        self._written_at_s = float("-inf")
        self._is_written = True

    @property
    def uses_versions(self) -> bool:
        """Whether there is a key, so that the book can read stations of a new version."""
        return self._reader.may_ask

    def note_version(self, version: NetworkVersion) -> None:
        """Note a network's version: stations of an earlier version are read again."""
        current = self._networks.get(version.network_id)
        if current is not None and current.sha256 == version.sha256:
            return
        self._networks[version.network_id] = _Version(version.sha256, _now_s())
        self._requested.update(dict.fromkeys(self._surroundings))
        self._has_news.set()

    def around(self, flight: FlyStep) -> Surroundings:
        """The surroundings of this flight; missing stations will be read."""
        box = TileBox.around(flight.from_position, flight.to_position)
        surroundings = self._surroundings.pop(box, None) or Surroundings(self._cache)
        self._surroundings[box] = surroundings
        if len(self._surroundings) > _MOST_SURROUNDINGS:
            oldest = next(iter(self._surroundings))
            del self._surroundings[oldest]
            self._requested.pop(oldest, None)
        if self._reader.may_ask and not self._is_fresh(box):
            self._requested[box] = None
            self._has_news.set()
        return surroundings

    async def run(self) -> None:
        """Read requested surroundings for ever; return when there is no key."""
        try:
            while self._reader.may_ask:
                await self._wait_until_requested()
                try:
                    await self._read_next()
                except CloudUnreachable as error:
                    log.warning("stations not read", extra={"reason": str(error)})
                    await asyncio.sleep(self._again_after_s)
        finally:
            if not self._is_written:
                self._file.write(self._cache)

    async def _wait_until_requested(self) -> None:
        """Return when surroundings are to be read; write the file while waiting."""
        while not (self._requested and self._networks):
            if not self._is_written and _now_s() - self._written_at_s >= _WRITE_EVERY_S:
                await self._write()
                continue
            self._has_news.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(None if self._is_written else _WRITE_EVERY_S):
                    await self._has_news.wait()

    async def _write(self) -> None:
        self._written_at_s, self._is_written = _now_s(), True
        writing = asyncio.create_task(
            asyncio.to_thread(self._file.write, tuple(self._cache)), name="landing book's file"
        )
        try:
            await asyncio.shield(writing)
        finally:
            # A stop of the agent does not stop the thread.
            await asyncio.wait((writing,))

    async def _read_next(self) -> None:
        box = next(iter(self._requested))
        # Removed before the read: a drone may request the box again during the read.
        del self._requested[box]
        unread = list(self._networks)
        try:
            while unread and self._reader.may_ask:
                if not self._is_fresh_in(unread[-1], box):
                    await self._read(box, unread[-1])
                unread.pop()
        finally:
            if unread:
                self._requested[box] = None
        if box in self._surroundings:
            self._surroundings[box].edition += 1

    async def _read(self, box: TileBox, network_id: NetworkId) -> None:
        asked_at_s = _now_s()
        try:
            found = await self._reader.stations_in(box, network_id)
        except CloudRefused as error:
            # The network is gone, or no key is left: a repeat does not help.
            log.warning("stations refused", extra={"reason": str(error)})
            return
        self._cache.put(network_id, box.tiles, found, at_s=asked_at_s)
        self._is_written = False
        log.info("stations read", extra={"network_id": network_id, "stations": len(found)})

    def _is_fresh(self, box: TileBox) -> bool:
        return bool(self._networks) and all(self._is_fresh_in(one, box) for one in self._networks)

    def _is_fresh_in(self, network_id: NetworkId, box: TileBox) -> bool:
        since_s = max(self._networks[network_id].noted_at_s, _now_s() - self._good_for_s)
        return all(self._cache.read_at_s(network_id, tile) >= since_s for tile in box.tiles)


def _now_s() -> float:
    return time.monotonic()
