"""Messages that no drone would send: not readable, with extreme values, or false."""

import asyncio
import json
import random
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Any, Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.chaos.faults.stage import Stage
from skyway_lab.benchmarks.chaos.schedule import PlannedFault
from skyway_lab.benchmarks.hostile.extremes import UNREADABLE, extreme_like

from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, TELEMETRY, Topic
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import MqttClient

_TOPICS: Final[tuple[Topic[Any], ...]] = (ACKS, EVENTS, STATE, TELEMETRY, CONNECTION)
#: In how many drones' names messages are published, and how many in each.
_DRONES, _MESSAGES_EACH = 4, 40
_CONNECTS_WITHIN_S: Final = 2.0
_BETWEEN_S: Final = 0.02


@asynccontextmanager
async def poisoned(stage: Stage, fault: PlannedFault) -> AsyncIterator[None]:
    """Publish poison while the block lasts: in the names of drones that fly, or of a rogue."""
    chance = random.Random(fault.seed)
    if fault.target == "drones":
        drones = chance.sample(stage.drones, min(_DRONES, len(stage.drones)))
        payloads = _unreadable(chance)
    else:
        drones = [stage.rogue]
        payloads = extreme_payloads(stage.rogue, chance, missions=stage.journals.mission_ids())
    url = stage.running.system.mqtt_url
    publishing = asyncio.create_task(_publish(url, drones, payloads, chance))
    try:
        yield
    finally:
        publishing.cancel()
        with suppress(asyncio.CancelledError):
            await publishing


async def _publish(
    url: str, drones: list[EnrolledDrone], payloads: Iterator[bytes], chance: random.Random
) -> None:
    for drone in drones:
        client = MqttClient(
            url,
            client_id=drone.user_name,
            user_name=drone.user_name,
            password=drone.mqtt.password,
        )
        with suppress(TimeoutError, MqttUnavailable):
            async with client, asyncio.timeout(_CONNECTS_WITHIN_S):
                await client.wait_connected()
                for _ in range(_MESSAGES_EACH):
                    topic = chance.choice(_TOPICS)
                    name = topic(drone.provider_id, drone.drone_id).name
                    await client.publish_raw(
                        name, next(payloads), mqtt_qos=topic.mqtt_qos, retained=False
                    )
                    await asyncio.sleep(_BETWEEN_S)


def _unreadable(chance: random.Random) -> Iterator[bytes]:
    while True:
        yield chance.choice(UNREADABLE)


def extreme_payloads(
    drone: EnrolledDrone, chance: random.Random, *, missions: Sequence[str]
) -> Iterator[bytes]:
    """Messages of every kind, without end: some values are extreme, or missions are of others."""
    forms = _forms(drone)
    while True:
        document = dict(chance.choice(forms))
        if "mission_id" in document and missions:
            document["mission_id"] = chance.choice(missions)
        for name in chance.sample(sorted(document), chance.randint(0, 3)):
            if name != "schema_version":
                document[name] = extreme_like(document[name], chance)
        yield json.dumps(document).encode()


def _forms(drone: EnrolledDrone) -> list[Mapping[str, Any]]:  # any JSON value
    """A message of each kind, readable."""
    at = "2026-03-02T08:17:00Z"
    message = {"schema_version": 1, "message_id": "msg_poison", "sent_at": at}
    numbered = message | {"session": 1_772_438_400, "seq": 9}
    place = {"position": list(drone.home_position), "soc": 0.7, "stream": 1}
    return [
        numbered
        | {"instruction_id": "ins_poison", "instruction_seq": 1, "stream": 1}
        | {"status": "ACCEPTED", "code": None, "detail": "fine", "data": {"need_j": 1.0}},
        numbered
        | place
        | {"event": "STEP_ENDED", "mission_id": "mis_poison", "mission_revision": 1, "step_id": 2}
        | {"step_kind": "DELIVER", "started_at": at, "ended_at": at, "package_ids": ["p1"]}
        | {"station_id": drone.home_station_id, "energy_j": 1.0, "data": {"place": "x"}},
        numbered
        | place
        | {"event": "ALARM", "ended_at": at, "code": "BATTERY_LOW", "detail": "x"}
        | {"level": "CRITICAL"},
        numbered
        | place
        | {"at": at, "activity": "FLYING", "last_instruction_seq": 1, "last_event_seq": 1}
        | {"mission_id": "mis_poison", "mission_revision": 1, "step_id": 2, "load_kg": 0.8}
        | {"released_through": 2, "package_ids": ["p1"], "is_held": False},
        numbered | place | {"at": at, "power_w": 612.3, "speed_mps": 22.0, "voltage_v": 46.1},
        message | {"session": 1_772_438_400, "connection_number": 1, "status": "ONLINE"},
    ]
