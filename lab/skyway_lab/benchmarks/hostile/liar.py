"""A drone that lies: it connects with valid credentials, takes missions, and says what it likes."""

import itertools
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any, Final

from pydantic import TypeAdapter
from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.chaos.cast import Cast

from skyway.cli.gateway import GatewayApi
from skyway.contracts.flight_step import FlightStep, FlyStep
from skyway.contracts.instruction import AnyInstruction, MissionInstruction
from skyway.contracts.topics import ACKS, CLOCK, CONNECTION, EVENTS, INSTRUCTIONS, STATE, Topic
from skyway.drone.models import DJI_MATRICE_300_RTK
from skyway.geo import Position
from skyway.ids import StationId
from skyway.runtime.clock import AnchoredClock
from skyway.runtime.mqtt.client import MqttClient

_DRONE: Final = TypeAdapter(EnrolledDrone)
_SESSION: Final = 1


@dataclass(slots=True)
class Liar:
    """A connected drone of a provider of its own, and its numbers."""

    drone: EnrolledDrone
    client: MqttClient
    clock: AnchoredClock
    home: Position
    instructions: AsyncIterator[list[Any]]
    event_seq: int = 0
    _seq: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    def soon(self) -> datetime:
        """Two seconds from now, fleet time."""
        return self.clock.now() + timedelta(seconds=2)

    async def mission(self) -> MissionInstruction:
        """The next mission that it is sent."""
        async for batch in self.instructions:
            for received in batch:
                instruction: AnyInstruction = received.message
                if isinstance(instruction, MissionInstruction):
                    return instruction
        raise AssertionError("the subscription has ended")

    async def answer(self, mission: MissionInstruction, status: str, **members: Any) -> None:
        """Answer an instruction."""
        body = {
            "instruction_id": mission.instruction_id,
            "instruction_seq": mission.seq,
            "stream": mission.stream,
            "status": status,
        }
        await self._say(ACKS, body | members)

    async def report(self, event: str, **members: Any) -> None:
        """Say that something has happened."""
        self.event_seq += 1
        body = {
            "seq": self.event_seq,
            "event": event,
            "stream": 1,
            "ended_at": self.soon().isoformat(),
            "position": [*self.home],
            "soc": 0.9,
        }
        await self._say(EVENTS, body | members)

    async def end(self, mission: MissionInstruction, step: FlightStep, **members: Any) -> None:
        """Say that a step has ended, soon and where it leads."""
        body = {
            "mission_id": mission.mission_id,
            "mission_revision": mission.mission_revision,
            "step_id": step.step_id,
            "step_kind": step.kind,
            "station_id": step.to_id if isinstance(step, FlyStep) else step.station_id,
        }
        await self.report("STEP_ENDED", **(body | members))

    async def stand(self, position: Position, *, soc: float = 0.9) -> None:
        """Say that it stands idle at a place."""
        body = {
            "at": self.clock.now().isoformat(),
            "activity": "IDLE",
            "stream": 0,
            "last_instruction_seq": 0,
            "last_event_seq": self.event_seq,
            "station_id": self.drone.home_station_id if position == self.home else None,
            "position": [*position],
            "soc": soc,
        }
        await self._say(STATE, body, retained=True)

    async def connect(self) -> None:
        """Say that it is connected, and stands at home."""
        body = {"connection_number": 1, "status": "ONLINE"}
        await self._say(CONNECTION, body, retained=True)
        await self.stand(self.home)

    async def _say(
        self, topic: Topic[Any], body: dict[str, Any], *, retained: bool = False
    ) -> None:
        number = next(self._seq)
        envelope = {
            "message_id": f"m{number}",
            "sent_at": self.clock.now().isoformat(),
            "session": _SESSION,
            "seq": number,
        }
        name = topic(self.drone.provider_id, self.drone.drone_id).name
        payload = json.dumps(envelope | body).encode()
        await self.client.publish_raw(name, payload, mqtt_qos=1, retained=retained)


@asynccontextmanager
async def lying(cast: Cast, api: GatewayApi, *, home: StationId) -> AsyncIterator[Liar]:
    """A new drone at this station while the block lasts."""
    terms = {"name": "Story Air", "tariff": {"currency": "USD", "base": 100, "per_km": 1}}
    provider = await api.call("POST", "/v1/providers", key=cast.operator_key, body=terms)
    path = f"/v1/providers/{provider['provider_id']}/drones"
    body = {"model_id": DJI_MATRICE_300_RTK.model_id, "home_station_id": home}
    drone = _DRONE.validate_python(await api.call("POST", path, key=cast.operator_key, body=body))
    columns = cast.city.network.columns
    row = cast.city.network.row_of[home]
    position = Position(float(columns.longitude_deg[row]), float(columns.latitude_deg[row]))
    user_name, password = drone.mqtt.user_name, drone.mqtt.password
    async with MqttClient(
        cast.running.system.mqtt_url,
        client_id=user_name,
        user_name=user_name,
        password=password,
    ) as client:
        clocks = client.batches(CLOCK())
        own = INSTRUCTIONS(drone.provider_id, drone.drone_id)
        instructions = client.batches(own)
        anchor = (await anext(clocks))[-1].message
        clock = AnchoredClock(anchor.fleet_at, anchor.wall_at, anchor.rate)
        liar = Liar(drone, client, clock, position, instructions)
        await liar.connect()
        yield liar
