"""Messages that no drone would send: not readable, with extreme values, or false."""

import asyncio
import json
import random
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from typing import Any, Final

from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone

from benchmarks.chaos.faults.stage import Stage
from benchmarks.chaos.schedule import PlannedFault
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, TELEMETRY, Topic
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import MqttClient

_TOPICS: Final[tuple[Topic[Any], ...]] = (ACKS, EVENTS, STATE, TELEMETRY, CONNECTION)
#: In how many drones' names messages are published, and how many in each.
_DRONES, _MESSAGES_EACH = 4, 40
_CONNECTS_WITHIN_S: Final = 2.0
_BETWEEN_S: Final = 0.02

#: Not readable: no JSON, no object, not this schema, too large, too deep.
UNREADABLE: Final = (
    b"{",
    b"null",
    b"[]",
    b"\x00",
    b"\xff\xfe\xfa",
    b'{"schema_version": 2}',
    b'{"seq": 1e999}',
    b'{"seq": ' + b"9" * 6_000 + b"}",
    b"[" * 20_000,
    b'{"detail": "\\ud800"}',
    b'{"detail": "' + b"x" * 200_000 + b'"}',
)

_MOMENTS: Final = ("0001-01-01T00:00:00Z", "9999-12-31T23:59:59Z", "2026-03-02T08:00:00+14:00")
_NUMBERS: Final = (0, 1, -1, 2**53 - 1, 2**53, 2**63, -(2**63), 1e308, -1e308, 5e-324)
_TEXTS: Final = ("", "\u0000", "x" * 10_000, "\u202e", "'; DROP TABLE missions; --", "😀")


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
                document[name] = _extreme(document[name], chance)
        yield json.dumps(document).encode()


def _extreme(value: object, chance: random.Random) -> object:
    """Another value that looks like this one."""
    match value:
        case bool():
            return not value
        case int() | float():
            return chance.choice(_NUMBERS)
        case str() if value[:2] == "20":
            return chance.choice(_MOMENTS)
        case str():
            return chance.choice(_TEXTS)
        case list():
            return [chance.choice(_NUMBERS) for _ in value]
        case _:
            return {chance.choice(_TEXTS): chance.choice((*_NUMBERS, *_TEXTS))}


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
