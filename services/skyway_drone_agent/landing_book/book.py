"""The landing book: one for all drones of a process, read from the cloud as their routes need.

Nobody waits for it. Without the network's version, a key or an answer drones fly with what they
know; what is read counts for the flights that are under way too.
"""

import asyncio
import contextlib
import logging
import time
from dataclasses import dataclass
from typing import Final

from skyway.contracts.flight_step import FlyStep
from skyway.contracts.world import NetworkVersion
from skyway.ids import NetworkId
from skyway_drone_agent.enrolment.cloud import CloudRefused, CloudUnreachable
from skyway_drone_agent.landing_book.station_cache import Surroundings
from skyway_drone_agent.landing_book.station_cache_file import StationCacheFile
from skyway_drone_agent.landing_book.station_reader import StationReader
from skyway_drone_agent.landing_book.tiles import TileBox

log = logging.getLogger(__name__)

#: Surroundings that are asked for again after so long (wall seconds) are read again: stations close
#: and open.
_GOOD_FOR_S: Final = 600.0

#: Wall seconds before a cloud that did not answer is asked again, and between two writes.
_AGAIN_AFTER_S, _WRITE_EVERY_S = 30.0, 60.0

#: The surroundings that are read again when the network changes: the last asked for.
_MOST_SURROUNDINGS: Final = 4_096


@dataclass(frozen=True, slots=True)
class _Version:
    """A network's content, and when it was first heard of."""

    sha256: str
    noted_at_s: float


class LandingBook:
    """Hears of networks, is asked for surroundings, and reads them one after the other."""

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
        """Whether it can do anything with a network's version."""
        return self._reader.may_ask

    def note_version(self, version: NetworkVersion) -> None:
        """A network has this version now: what was read of another one is read again."""
        known = self._networks.get(version.network_id)
        if known is not None and known.sha256 == version.sha256:
            return
        self._networks[version.network_id] = _Version(version.sha256, _now_s())
        self._requested.update(dict.fromkeys(self._surroundings))
        self._has_news.set()

    def around(self, flight: FlyStep) -> Surroundings:
        """What is known around this flight; what is not known there will be read."""
        box = TileBox.around(flight.from_position, flight.to_position)
        known = self._surroundings.pop(box, None) or Surroundings(self._cache)
        self._surroundings[box] = known
        if len(self._surroundings) > _MOST_SURROUNDINGS:
            forgotten = next(iter(self._surroundings))
            del self._surroundings[forgotten]
            self._requested.pop(forgotten, None)
        if self._reader.may_ask and not self._is_fresh(box):
            self._requested[box] = None
            self._has_news.set()
        return known

    async def run(self) -> None:
        """Read what is wanted, for ever; without a key it is over at once."""
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
        """Return when something is to be read; write meanwhile."""
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
            # Who stops the agent does not stop the thread.
            await asyncio.wait((writing,))

    async def _read_next(self) -> None:
        box = next(iter(self._requested))
        # Before it is read: it may be wanted again meanwhile.
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
            # No such network any more, or no key is left: it is no use to ask again.
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
