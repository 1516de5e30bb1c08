"""One drone's agent: connects it to the cloud, and serves it once fleet time is set."""

import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from types import TracebackType
from typing import Any, Never, Protocol, Self

from skyway.contracts.drone_report import Connection
from skyway.contracts.topics import CLOCK, NETWORK_VERSION, Address
from skyway.contracts.world import ClockAnchor, NetworkVersion
from skyway.runtime.clock import fleet_margin
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.loops import Loops
from skyway.runtime.minting import Mint
from skyway.runtime.mqtt.client import Received, Will
from skyway_drone_agent.analysis.landings import NO_LANDINGS, LandingSource
from skyway_drone_agent.clock_keeper import ClockFromCloud
from skyway_drone_agent.cockpit import Cockpit
from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_drone_agent.journal.flight_recorder import FlightRecorder, NewsOrMoment
from skyway_drone_agent.journal.journal import Journal
from skyway_drone_agent.link.uplink import Link, Presence, Uplink
from skyway_drone_agent.messages.inbox import RAW_INSTRUCTIONS
from skyway_drone_agent.vehicle import Vehicle

#: Wall seconds that a farewell may take.
_FAREWELL_S = 1.0

#: Wall seconds between two attempts to write the session on a full disk.
_ROOM_EVERY_S = 1.0


class OpenableLink(Link, Protocol):
    """A link that connects while it is entered."""

    async def __aenter__(self) -> Self: ...

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None: ...


class VersionedLandings(LandingSource, Protocol):
    """A source of landings that reads stations again when a network has a new version."""

    @property
    def uses_versions(self) -> bool:
        """Whether the source needs the versions of networks."""
        ...

    def note_version(self, version: NetworkVersion) -> None:
        """Note that a network has this version now."""
        ...


#: Makes the link of a drone; gets its last will, and a callback for each connect.
MakeLink = Callable[[Will, Callable[[], Awaitable[None]]], OpenableLink]


class DroneAgent:
    """Serves a drone until the task is cancelled; the next agent continues from its journal."""

    def __init__(
        self,
        drone: EnrolledDrone,
        *,
        journal: Journal,
        vehicle: Vehicle,
        clock: ClockFromCloud,
        make_link: MakeLink,
        mint: Mint,
        book: VersionedLandings | None = None,
        api_url: str = "",
    ) -> None:
        self._drone = drone
        self._api_url = api_url
        self._book = book
        self._vehicle = vehicle
        self._clock = clock
        self._mint = mint
        self._recorder = FlightRecorder(journal, drone_id=drone.drone_id, at_first=drone.at_first())
        self._recorder.begin_session(clock.wall_now())
        self._presence = Presence(
            clock,
            provider_id=drone.provider_id,
            drone_id=drone.drone_id,
            session=self._recorder.logbook.session,
            mint=mint,
        )
        self._link = make_link(self._presence.last_will, self._connected)
        self._cockpit: Cockpit | None = None  # None until fleet time is set

    async def run(self) -> None:
        """Serve the drone; at the end report to the cloud that it leaves on purpose."""
        here = (self._drone.provider_id, self._drone.drone_id)
        anchors = self._link.batches(CLOCK())
        instructions = self._link.batches(RAW_INSTRUCTIONS(*here))
        book = self._book if self._book is not None and self._book.uses_versions else None
        versions = None if book is None else self._link.batches(NETWORK_VERSION)
        async with contextlib.AsyncExitStack() as linked, Loops() as loops:
            loops.start("link", self._connect(linked))
            loops.start("clock", self._keep_time(anchors))
            if book is not None and versions is not None:
                loops.start("landing book", _note_versions(book, versions))
            try:
                # Without fleet time no instruction can be judged: they wait until it is set.
                await self._clock.wait_until_set()
                await self._fly(instructions, loops)
            finally:
                await self._say_goodbye()

    async def _connect(self, linked: contextlib.AsyncExitStack) -> None:
        """Connect once the session is written: a later start must never use the same session.

        Until the disk has room for the session, the drone behaves as with a lost link.
        """
        recorder, clock = self._recorder, self._clock
        with NewsOrMoment(recorder.watch(), clock) as room:
            while not recorder.has_session:
                recorder.make_room()
                pause = fleet_margin(clock, fleet_s=0.0, wall_s=_ROOM_EVERY_S)
                await room.wait(until=clock.now() + pause)
        await linked.enter_async_context(self._link)

    async def _fly(self, instructions: AsyncIterator[list[Received[Any]]], loops: Loops) -> Never:
        """Everything that needs fleet time."""
        drone_id = self._drone.drone_id
        uplink = Uplink(
            self._link,
            self._clock,
            provider_id=self._drone.provider_id,
            drone_id=drone_id,
            session=self._recorder.logbook.session,
            mint=self._mint,
        )
        cockpit = self._cockpit = Cockpit.of(
            self._recorder,
            self._vehicle,
            clock=self._clock,
            link=self._link,
            uplink=uplink,
            drone_id=drone_id,
            book=self._book or NO_LANDINGS,
            api_url=self._api_url,
        )
        if self._link.is_connected:
            await self._say_online()
        for part in cockpit.parts:
            loops.start(type(part).__name__, part.run())
        loops.start("inbox", _handle_instructions(instructions, cockpit))
        await cockpit.pilot.run()

    async def _keep_time(self, batches: AsyncIterator[list[Received[ClockAnchor]]]) -> None:
        async for batch in batches:
            self._clock.keep(batch[-1].message)
            if self._cockpit is not None:
                self._cockpit.cloud_monitor.note_clock(is_repeated=not batch[-1].retained)

    async def _connected(self) -> None:
        """Announce the drone, once it can handle instructions."""
        cockpit = self._cockpit
        if cockpit is None:
            return
        cockpit.cloud_monitor.note_message()
        cockpit.link_monitor.came_up()
        # Before the broker confirms anything: a state may already wait for the connection.
        cockpit.state.send_anew()
        await self._say_online()

    async def _say_online(self) -> None:
        with contextlib.suppress(MqttUnavailable):
            await self._link.publish(self._presence.address, self._presence.online())

    async def _say_goodbye(self) -> None:
        address: Address[Connection] = self._presence.address
        with contextlib.suppress(MqttUnavailable):
            await self._link.publish(address, self._presence.offline(), timeout_s=_FAREWELL_S)


async def _note_versions(
    book: VersionedLandings, batches: AsyncIterator[list[Received[NetworkVersion]]]
) -> None:
    async for batch in batches:
        for received in batch:
            book.note_version(received.message)


async def _handle_instructions(
    batches: AsyncIterator[list[Received[Any]]], cockpit: Cockpit
) -> None:
    """Pass instructions to the inbox. Any: the inbox parses them itself."""
    async for batch in batches:
        cockpit.cloud_monitor.note_message()
        for received in batch:
            cockpit.inbox.handle(received.message)
