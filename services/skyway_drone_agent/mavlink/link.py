"""A MAVLink connection in the event loop, and the commands that are sent over it.

pymavlink is imported only when a connection is opened. After that pymavlink reads and writes
without waiting, so the event loop watches its file descriptor. Only the opening may wait, so it
runs in a thread.
"""

import asyncio
import contextlib
import logging
import os
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from typing import Any, Final, Never, TypeVar

from skyway.runtime.clock import FleetClock, sleep_wall
from skyway.runtime.errors import InvalidSettings
from skyway_drone_agent.mavlink.fields import MavlinkMessage

log = logging.getLogger(__name__)

#: Wall seconds between two heartbeats of ours, as MAVLink asks of every component.
_HEARTBEAT_S: Final = 1.0

#: Our system id before we know the drone's own. Then we use that one, so that the drone's autopilot
#: takes us for its companion.
_FIRST_SYSTEM: Final = 1

#: MAV_TYPE: what flies. Not antenna trackers and ground vehicles, which have autopilots too.
_AIRCRAFT: Final = frozenset(
    (*range(5), *range(7, 10), *range(13, 18), *range(19, 26), 28, 29, 35, 43)
)

T = TypeVar("T")


class NoMavlink(InvalidSettings):
    """MAVLink cannot be spoken: the extra is missing, or the address is wrong."""


class MessageQueue:
    """Collects the autopilot's messages of some types."""

    def __init__(self, types: frozenset[str], clock: FleetClock) -> None:
        self.types = types
        self._clock = clock
        self._queue: asyncio.Queue[MavlinkMessage] = asyncio.Queue()

    def put(self, message: MavlinkMessage) -> None:
        """Add a message of these types."""
        self._queue.put_nowait(message)

    async def next(self, timeout_s: float) -> MavlinkMessage | None:
        """The next message; None when none arrives in so many seconds of wall time."""
        if not self._queue.empty():
            return self._queue.get_nowait()
        return await finished_within(self._clock, timeout_s, self._queue.get())


class MavlinkLink:
    """Messages from and to one autopilot; `mav` sends, with pymavlink's own methods."""

    def __init__(
        self,
        connection: Any,  # pymavlink has no types
        dialect: Any,
        clock: FleetClock,
        *,
        system_id: int | None = None,
    ) -> None:
        self._connection = connection
        self._system_id = system_id
        self._others: set[tuple[int, int]] = set()
        self.clock = clock
        self._queues: list[MessageQueue] = []
        self._listeners: list[Callable[[MavlinkMessage], None]] = []
        self.dialect = dialect
        self.mav = connection.mav
        self._target: asyncio.Future[tuple[int, int]] = asyncio.get_running_loop().create_future()

    def listen(self, listener: Callable[[MavlinkMessage], None]) -> None:
        """Call the listener with every message of the autopilot from now on."""
        self._listeners.append(listener)

    @contextlib.contextmanager
    def receiving(self, *types: str) -> Iterator[MessageQueue]:
        """Collect the autopilot's messages of these types in the block."""
        queue = MessageQueue(frozenset(types), self.clock)
        self._queues.append(queue)
        try:
            yield queue
        finally:
            self._queues.remove(queue)

    async def target(self) -> tuple[int, int]:
        """The autopilot's system and component, once its first heartbeat has arrived."""
        return await asyncio.shield(self._target)

    def read(self) -> None:
        """Pass on every message that has arrived."""
        while (message := self._connection.recv_msg()) is not None:
            kind = message.get_type()
            if kind == "BAD_DATA":
                continue
            source = (message.get_srcSystem(), message.get_srcComponent())
            if kind == "HEARTBEAT" and is_of_aircraft(message, self.dialect):
                self._found(source)
            if source != self._chosen or not self._is_for_us(message):
                continue
            for listener in self._listeners:
                listener(message)
            for queue in self._queues:
                if kind in queue.types:
                    queue.put(message)

    def _found(self, source: tuple[int, int]) -> None:
        source_ids = {"system": source[0], "component": source[1]}
        if not self._target.done() and self._system_id in (None, source[0]):
            self._target.set_result(source)
            self.mav.srcSystem = source[0]
            log.info("autopilot found", extra=source_ids)
        elif source not in self._others and source != self._chosen:
            self._others.add(source)
            log.warning(
                "another autopilot on the link is ignored: see --system-id", extra=source_ids
            )

    @property
    def _chosen(self) -> tuple[int, int] | None:
        return self._target.result() if self._target.done() else None

    def _is_for_us(self, message: MavlinkMessage) -> bool:
        """Whether a message is for everybody or for us, not an answer to another ground station."""
        return getattr(message, "target_system", 0) in (0, self.mav.srcSystem) and getattr(
            message, "target_component", 0
        ) in (0, self.mav.srcComponent)

    async def beat(self) -> Never:
        """Send our heartbeat for ever."""
        kind = self.dialect.MAV_TYPE_ONBOARD_CONTROLLER
        nothing, active = self.dialect.MAV_AUTOPILOT_INVALID, self.dialect.MAV_STATE_ACTIVE
        while True:
            self.mav.heartbeat_send(kind, nothing, 0, 0, active)
            await sleep_wall(self.clock, _HEARTBEAT_S)


def is_of_aircraft(heartbeat: MavlinkMessage, dialect: Any) -> bool:  # pymavlink's numbers
    """Whether a heartbeat comes from the autopilot of a drone, not from a camera or a person."""
    is_autopilot = heartbeat.autopilot != dialect.MAV_AUTOPILOT_INVALID
    return is_autopilot and heartbeat.type in _AIRCRAFT


@contextlib.asynccontextmanager
async def mavlink_link(
    address: str, clock: FleetClock, *, system_id: int | None = None
) -> AsyncIterator[MavlinkLink]:
    """The connection at an address in pymavlink's form: ``udpin:127.0.0.1:14550``.

    Without `system_id` the first autopilot that sends is the drone's.

    Raises
    ------
    NoMavlink
        pymavlink is not installed, or cannot open the address.
    """
    connection, dialect = await asyncio.to_thread(_opened, address)
    link = MavlinkLink(connection, dialect, clock, system_id=system_id)
    loop, descriptor = asyncio.get_running_loop(), connection.fd
    loop.add_reader(descriptor, link.read)
    beating = asyncio.create_task(link.beat())
    try:
        yield link
    finally:
        beating.cancel()
        loop.remove_reader(descriptor)
        connection.close()


def _opened(address: str) -> tuple[Any, Any]:  # pymavlink has no types
    # Read by pymavlink while it is imported: version 2 of the protocol, and its common messages.
    os.environ.setdefault("MAVLINK20", "1")
    os.environ.setdefault("MAVLINK_DIALECT", "common")
    try:
        from pymavlink import mavutil
    except ImportError as error:
        raise NoMavlink("pymavlink is not installed: pip install 'skyway[mavlink]'") from error
    companion = mavutil.mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
    try:
        connection = mavutil.mavlink_connection(
            address, source_system=_FIRST_SYSTEM, source_component=companion
        )
    except (OSError, ValueError, IndexError) as error:
        raise NoMavlink(f"no MAVLink connection at {address}: {error}") from error
    if getattr(connection, "fd", None) is None:
        raise NoMavlink(f"{address} is no address of a vehicle")
    return connection, mavutil.mavlink


#: Wall seconds before a command that was not answered is sent again, and how often it is sent.
_TIMEOUT_S: Final = 1.5
_TIMES: Final = 5

#: Wall seconds that an answer may take once the autopilot reports that it works on the command.
_AT_WORK_S: Final = 30.0


async def command(link: MavlinkLink, command_id: int, *params: float) -> int | None:
    """The autopilot's MAV_RESULT for a command that may be sent again; None without an answer."""
    for confirmation in range(_TIMES):
        result = await _sent(
            link, command_id, params, confirmation=confirmation, timeout_s=_TIMEOUT_S
        )
        if result is not None:
            return result
    return None


async def command_once(
    link: MavlinkLink, command_id: int, *params: float, timeout_s: float
) -> int | None:
    """The MAV_RESULT of a command that must not be done twice; None if it is unknown."""
    return await _sent(link, command_id, params, confirmation=0, timeout_s=timeout_s)


async def _sent(
    link: MavlinkLink,
    command_id: int,
    params: tuple[float, ...],
    *,
    confirmation: int,
    timeout_s: float,
) -> int | None:
    target = await link.target()
    seven = (*params, *[0.0] * 7)[:7]
    with link.receiving("COMMAND_ACK") as answers:
        link.mav.command_long_send(*target, command_id, confirmation, *seven)
        while (answer := await answers.next(timeout_s)) is not None:
            if answer.command != command_id:
                continue
            if answer.result != link.dialect.MAV_RESULT_IN_PROGRESS:
                return int(answer.result)
            timeout_s = _AT_WORK_S
    return None


async def finished_within(
    clock: FleetClock, wall_s: float | None, work: Coroutine[Any, Any, T]
) -> T | None:
    """The result of the work; None when it takes longer than so many seconds of wall time.

    The clock measures the time, so that tests can move it. Without `wall_s` there is no limit.
    """
    if wall_s is None:
        return await work
    working, alarm = asyncio.ensure_future(work), asyncio.ensure_future(sleep_wall(clock, wall_s))
    try:
        await asyncio.wait((working, alarm), return_when=asyncio.FIRST_COMPLETED)
        return working.result() if working.done() else None
    finally:
        working.cancel()
        alarm.cancel()
