"""An autopilot at the other end of a loopback socket: it speaks the mission protocol, and flies."""

import asyncio
import contextlib
import os
import secrets
import socket
from collections import Counter
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from skyway_drone_agent.mavlink.link import MavlinkLink, mavlink_link
from skyway_drone_agent.mavlink.settings import MavlinkSettings, PayloadRelease
from skyway_drone_agent.mavlink.vehicle import ready_vehicle
from skyway_drone_agent.vehicle import BatteryPack

from skyway.geo import Position, point_between
from skyway.runtime.clock import FleetClock, sleep_wall

os.environ.setdefault("MAVLINK20", "1")
os.environ.setdefault("MAVLINK_DIALECT", "common")

mavutil = pytest.importorskip("pymavlink.mavutil")
mavlink = mavutil.mavlink

#: Wall seconds between two ticks of the autopilot, and ticks that it needs to fly an item.
TICK_S, TICKS_PER_ITEM = 0.1, 15

#: Below the ports that kernels choose from, when a program asks for any free port.
PORTS = range(20_000, 32_000)

#: Turns of the event loop in which everybody reacts to what has arrived,
#: and the most of them in which the socket may become quiet.
TURNS, MOST_TURNS = 40, 20_000


class Peer:
    """A simulated autopilot on pymavlink; tests make it lose, repeat or refuse messages."""

    def __init__(self, port: int, clock: FleetClock, *, kind: int, position: Position) -> None:
        self.clock = clock
        self.connection = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=1, source_component=1
        )
        self.kind = kind
        self.position = position
        self.soc = 1.0
        self.is_armed = False
        self.is_in_air = False
        self.item = 0
        self.is_flying_mission = False
        self.missions: list[list[Any]] = []
        self.incoming: list[Any] = []
        self.released = 0
        self.modes: list[int] = []
        #: How often each message was asked for.
        self.asked: Counter[int] = Counter()
        #: How many messages of a type get lost before or after the peer; types that are sent twice.
        self.lost_messages: Counter[str] = Counter()
        self.not_sent: Counter[str] = Counter()
        self.sent_twice: set[str] = set()
        #: Answers other than ACCEPTED by command, and the item that the peer refuses.
        self.answers: dict[int, int] = {}
        self.refused_item: int | None = None
        #: Commands that the peer carries out without an answer.
        self.unanswered: set[int] = set()
        #: While this is set, no item is flown to its end.
        self.hovers = False
        self.lands_at: Position | None = None
        self._expected = 0
        self._ticks = 0
        self._from = position

    # Talking

    def send(self, kind: str, *values: Any) -> None:
        if self.not_sent[kind] > 0:
            self.not_sent[kind] -= 1
            return
        for _ in range(2 if kind in self.sent_twice else 1):
            getattr(self.connection.mav, f"{kind.lower()}_send")(*values)

    def read(self) -> None:
        while (message := self.connection.recv_msg()) is not None:
            kind = message.get_type()
            if self.lost_messages[kind] > 0:
                self.lost_messages[kind] -= 1
                continue
            handler = getattr(self, f"on_{kind.lower()}", None)
            if handler is not None:
                handler(message)

    async def live(self) -> None:
        while True:
            self.say_how_it_is()
            if self.is_armed and self.is_flying_mission and self.missions:
                self.fly()
            await sleep_wall(self.clock, TICK_S)

    def say_how_it_is(self) -> None:
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.is_armed else 0
        self.send("HEARTBEAT", mavlink.MAV_TYPE_HEXAROTOR, self.kind, mode, 0, 4)
        self.send("EXTENDED_SYS_STATE", 0, 2 if self.is_in_air else 1)
        longitude, latitude = (round(degrees * 1e7) for degrees in self.position)
        self.send("GLOBAL_POSITION_INT", 0, latitude, longitude, 0, 0, 0, 0, 0, 0)
        self.send("GPS_RAW_INT", 0, 3, latitude, longitude, 0, 0, 0, 0, 0, 10)
        cell_mv = round(BatteryPack().open_voltage_v(self.soc) / 6 * 1000)
        cells = [cell_mv] * 6 + [65_535] * 4
        remaining = round(self.soc * 100)
        self.send("BATTERY_STATUS", 0, 0, 0, 2_500, cells, 0, -1, -1, remaining)
        self.send("MISSION_CURRENT", self.item)

    # The mission protocol, from the vehicle's side

    def on_mission_count(self, message: Any) -> None:
        self.incoming = [None] * message.count
        self._ask_for(0)

    def on_mission_item_int(self, message: Any) -> None:
        if message.seq != self._expected or not self.incoming:
            return
        if message.seq == self.refused_item:
            self.send("MISSION_ACK", 1, 191, mavlink.MAV_MISSION_UNSUPPORTED)
            return
        self.incoming[message.seq] = message
        if message.seq + 1 < len(self.incoming):
            self._ask_for(message.seq + 1)
            return
        self.missions.append(self.incoming)
        self.incoming, self.item, self._ticks = [], 0, 0
        self._from = self.position
        self.send("MISSION_ACK", 1, 191, mavlink.MAV_MISSION_ACCEPTED)

    def _ask_for(self, seq: int) -> None:
        self._expected = seq
        self.send("MISSION_REQUEST_INT", 1, 191, seq)

    def on_mission_set_current(self, message: Any) -> None:
        self.item = message.seq

    def on_command_long(self, message: Any) -> None:
        answer = self.answers.get(message.command, mavlink.MAV_RESULT_ACCEPTED)
        if message.command == mavlink.MAV_CMD_MISSION_START and (message.param1 or message.param2):
            answer = mavlink.MAV_RESULT_DENIED  # as ArduPilot does
        if answer == mavlink.MAV_RESULT_ACCEPTED:
            self.do(message)
        if message.command not in self.unanswered:
            self.send("COMMAND_ACK", message.command, answer)

    def do(self, message: Any) -> None:
        match message.command:
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.is_armed = message.param1 == 1.0
            case mavlink.MAV_CMD_MISSION_START:
                self.is_flying_mission = True
            case mavlink.MAV_CMD_DO_GRIPPER | mavlink.MAV_CMD_DO_SET_SERVO:
                self.released += 1
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                self.asked[int(message.param1)] += 1
            case mavlink.MAV_CMD_DO_SET_MODE:
                self.modes.append(int(message.param2))
            case mavlink.MAV_CMD_NAV_LAND:
                self.is_in_air = self.is_armed = self.is_flying_mission = False

    # Flying

    def fly(self) -> None:
        items = self.missions[-1]
        item = items[self.item]
        if self.hovers and item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            return
        self._ticks += 1
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            self.soc -= 0.04 / TICKS_PER_ITEM
            to = Position(item.y / 1e7, item.x / 1e7)
            fraction = self._ticks / TICKS_PER_ITEM
            self.position = point_between(self._from, to, fraction=fraction)
            if self._ticks < TICKS_PER_ITEM:
                return
        self.is_in_air = item.command != mavlink.MAV_CMD_NAV_LAND
        self.send("MISSION_ITEM_REACHED", self.item)
        self._from, self._ticks = self.position, 0
        if not self.is_in_air:
            self.position = self.lands_at or self.position
            self.is_armed = self.is_flying_mission = False
        elif self.item + 1 < len(items):
            self.item += 1


@pytest.fixture(params=["PX4", "ArduPilot"])
def kind(request: pytest.FixtureRequest) -> int:
    """The two families of autopilots differ in where a mission begins."""
    px4, ardupilot = mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    return int(px4 if request.param == "PX4" else ardupilot)


@pytest.fixture
def port() -> int:
    """A free port that the kernel does not give to another process in the meantime."""
    while True:
        chosen = secrets.choice(PORTS)
        with contextlib.suppress(OSError), socket.socket(type=socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", chosen))
            return chosen


@pytest.fixture
async def peer(port: int, kind: int, drone: Any, world: Any) -> AsyncIterator[Peer]:
    """An autopilot that stands at home and talks to this port."""
    made = Peer(port, world.clock, kind=kind, position=drone.home_position)
    loop = asyncio.get_running_loop()
    loop.add_reader(made.connection.fd, made.read)
    living = asyncio.create_task(made.live())
    yield made
    living.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await living
    loop.remove_reader(made.connection.fd)
    made.connection.close()


class Wire:
    """The two ends of the socket; it is quiet when each end has read what the other sent."""

    def __init__(self, peer: Peer, link: MavlinkLink) -> None:
        self._ends = (peer.connection.mav, link.mav)
        #: Packets that were sent before the other end was there.
        self._lost = self._unread()

    def _unread(self) -> tuple[int, int]:
        one, other = self._ends
        return (
            one.total_packets_sent - other.total_packets_received,
            other.total_packets_sent - one.total_packets_received,
        )

    async def settle(self) -> None:
        """Let everything run that can run now, and let every message arrive."""
        quiet_turns = 0
        for _ in range(MOST_TURNS):
            await asyncio.sleep(0)
            quiet_turns = quiet_turns + 1 if self._unread() == self._lost else 0
            if quiet_turns == TURNS:
                return
        # The kernel has dropped a packet, as it may with UDP.
        self._lost = self._unread()


@pytest.fixture
async def vehicle(peer: Peer, port: int, drone: Any, world: Any) -> AsyncIterator[Any]:
    """The drone that the peer flies; calling the fixture makes it again, as a new process would.

    `world` starts its agents with the one made last.
    """
    settings = MavlinkSettings(
        f"udpin:127.0.0.1:{port}", PayloadRelease(1), altitude_m=60.0, release_s=1.0
    )
    async with contextlib.AsyncExitStack() as stack:

        async def anew() -> None:
            await stack.aclose()
            link = await stack.enter_async_context(mavlink_link(settings.address, world.clock))
            peer.say_how_it_is()
            await link.target()
            wire = Wire(peer, link)
            getting_ready = asyncio.create_task(
                ready_vehicle(drone.model, world.clock, link, settings)
            )
            while not getting_ready.done():
                peer.say_how_it_is()
                await wire.settle()
            made = await getting_ready
            world.settle = wire.settle
            world.vehicle_type = lambda *_model, **_disturbances: made

        await anew()
        yield anew
        await world.stop()


@pytest.fixture
def until(world: Any) -> Callable[[Callable[[], bool]], Any]:
    """Let time pass until a claim holds."""

    async def wait(holds: Callable[[], bool]) -> None:
        await world.pass_until(holds)

    return wait
