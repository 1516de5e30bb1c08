"""The rogues: a customer, a provider, a drone and callers without a key, and all that they send."""

import asyncio
import random
import re
from collections import Counter
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Final

import aiohttp
from skyway_drone_agent.enrolment.enrolled_drone import EnrolledDrone
from skyway_lab.benchmarks.chaos.cast import Cast
from skyway_lab.benchmarks.chaos.faults.poison import extreme_payloads
from skyway_lab.benchmarks.hostile.calls import Forged, all_calls, every_variant, forged_calls
from skyway_lab.benchmarks.hostile.extremes import UNREADABLE, extreme_text
from skyway_lab.benchmarks.load.world import Customer
from yarl import URL

from skyway.cli.gateway import GatewayApi
from skyway.contracts.topics import ACKS, CONNECTION, EVENTS, STATE, TELEMETRY
from skyway.ids import DeliveryId
from skyway.runtime.errors import MqttUnavailable
from skyway.runtime.mqtt.client import MqttClient
from skyway.runtime.signing.key_pair import PrivateKey

#: Wall seconds: how long a rogue waits for an answer, and between two messages on the broker.
#: A busy machine may stand still for a quarter of a minute.
_ANSWER_WITHIN_S: Final = 60.0
_BETWEEN_MESSAGES_S: Final = 0.02
_CONNECTS_WITHIN_S: Final = 2.0
#: The address from which rogues call.
_ADDRESS: Final = "127.0.0.2"
_DELIVERY: Final = re.compile(rb"dlv_\w+")
#: Calls of each rogue that are under way together.
_TOGETHER: Final = 4


@dataclass(slots=True)
class Answers:
    """How rogues were answered: counts by status or error, and the calls that broke a server."""

    counts: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)
    #: Deliveries that rogues requested themselves, without a fault.
    deliveries: set[DeliveryId] = field(default_factory=set)
    is_over: bool = False
    messages: int = 0
    #: Calls that each rogue has sent. The first `variants` of them are every extreme value at every
    #: place, each once.
    sent: Counter[str] = field(default_factory=Counter)
    variants: int = 0


@dataclass(frozen=True, slots=True)
class Rogue:
    """Who sends calls: a name for people, and the headers that say who it is."""

    name: str
    headers: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Rogues:
    """All rogues of a run; their drone is the one of `Stage.rogue`."""

    callers: tuple[Rogue, ...]
    customer: Customer
    #: Ids that exist by the names of the parameters that want them, own and foreign.
    known: Mapping[str, Sequence[str]]


async def register_rogues(cast: Cast) -> Rogues:
    """A customer, a key for the rogue provider, which may fly now, and what they know."""
    drone = cast.stage.rogue
    async with GatewayApi(cast.running.system.urls["gateway"]) as api:
        key = cast.operator_key
        await api.call(
            "PATCH", f"/v1/providers/{drone.provider_id}", key=key, body={"state": "ACTIVE"}
        )
        subject = {"role": "provider", "subject_id": drone.provider_id}
        provider = await api.call("POST", "/v1/keys", key=key, body=subject)
        drone_key = await _enrolled(api, drone, operator_key=key)
        issued = await api.call(
            "POST", "/v1/keys", key=key, body={"role": "customer", "subject_id": "rogue"}
        )
    customer = Customer(
        issued["subject_id"],
        issued["key"],
        issued["mqtt"]["user_name"],
        issued["mqtt"]["password"],
    )
    callers = (
        Rogue("customer", _authorized(customer.key)),
        Rogue("provider", _authorized(provider["key"])),
        Rogue("drone", _authorized(drone_key)),
        Rogue("no key", {}),
        Rogue("wrong key", _authorized("sk_" + "x" * 5_000)),
    )
    return Rogues(callers, customer, _known(cast))


async def _enrolled(api: GatewayApi, drone: EnrolledDrone, *, operator_key: str) -> str:
    """The key of another drone of the rogue provider."""
    drones = f"/v1/providers/{drone.provider_id}/drones"
    body = {"model_id": drone.model.model_id, "home_station_id": drone.home_station_id}
    other = await api.call("POST", drones, key=operator_key, body=body)
    path = f"{drones}/{other['drone_id']}/enrolment-tokens"
    token = await api.call("POST", path, key=operator_key)
    enrolment = {
        "enrolment_token": token["enrolment_token"],
        "public_key": PrivateKey.new().public_key,
    }
    enrolled = await api.call("POST", "/v1/enrolments", key=operator_key, body=enrolment)
    return str(enrolled["key"])


def _authorized(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def _known(cast: Cast) -> dict[str, tuple[str, ...]]:
    stations = tuple(cast.city.network.columns.station_ids)
    flying = cast.stage.drones
    return {
        "delivery_id": tuple(cast.customers.requests.accepted),
        "mission_id": tuple(cast.stage.journals.mission_ids()),
        "drone_id": (cast.stage.rogue.drone_id, *(each.drone_id for each in flying)),
        "provider_id": (cast.stage.rogue.provider_id, flying[0].provider_id),
        "network_id": ("city",),
        "webhook_id": tuple(cast.webhook_ids.values()),
        **dict.fromkeys(("station_id", "from_id", "to_id", "home_station_id"), stations),
        "pad": ("1", "2"),
        "model_id": ("dji-matrice-300-rtk",),
    }


@asynccontextmanager
async def attacking(cast: Cast, rogues: Rogues, *, seed: int) -> AsyncIterator[Answers]:
    """Let all rogues call and publish while the block lasts."""
    answers = Answers()
    calls = all_calls()
    answers.variants = sum(1 for call in calls for _ in every_variant(call))
    calling = []
    for rogue in rogues.callers:
        chance = random.Random(f"{rogue.name} {seed}")
        forged = forged_calls(calls, rogues.known, chance)
        calling += [
            asyncio.create_task(_call_again_and_again(cast, rogue, forged, answers))
            for _ in range(_TOGETHER)
        ]
    publishing = asyncio.create_task(_publish_without_end(cast, rogues, answers, seed))
    try:
        yield answers
    finally:
        # Each rogue waits for its last answer: it may be a delivery.
        answers.is_over = True
        publishing.cancel()
        ends = await asyncio.gather(*calling, publishing, return_exceptions=True)
    for end in ends:
        if isinstance(end, Exception):
            raise end


async def _call_again_and_again(
    cast: Cast, rogue: Rogue, every: Iterator[Forged], answers: Answers
) -> None:
    timeout = aiohttp.ClientTimeout(total=_ANSWER_WITHIN_S)
    url = cast.running.system.urls["gateway"]
    connector = aiohttp.TCPConnector(local_addr=(_ADDRESS, 0))
    async with aiohttp.ClientSession(
        connector=connector, timeout=timeout, headers=rogue.headers
    ) as client:
        for forged in every:
            if answers.is_over:
                return
            await _send(client, url, rogue, forged, answers)


async def _send(
    client: aiohttp.ClientSession, url: str, rogue: Rogue, forged: Forged, answers: Answers
) -> None:
    headers = {"Content-Type": "application/json"} if forged.body is not None else {}
    target = URL(url + forged.target, encoded=True)
    seen, text = "no answer", b""
    try:
        async with client.request(
            forged.call.method, target, data=forged.body, headers=headers
        ) as answer:
            seen = str(answer.status)
            # A stream of events has no end.
            text = await answer.content.read(2_000)
    except (aiohttp.ClientError, TimeoutError) as error:
        if not isinstance(error, TimeoutError):
            seen = type(error).__name__
    answers.counts[seen] += 1
    answers.sent[rogue.name] += 1
    if seen == "202" and (named := _DELIVERY.search(text)):
        answers.deliveries.add(DeliveryId(named[0].decode()))
    if seen.startswith("5") or seen == "no answer":
        answers.broken.append(
            f"{rogue.name}: {forged.call.name}: {seen} {text!r:.200}; "
            f"{forged.target!r:.300} {forged.body!r:.500}"
        )


async def _publish_without_end(cast: Cast, rogues: Rogues, answers: Answers, seed: int) -> None:
    """Publish as the drone and as the customer, in turns, on topics of their own and of others."""
    chance = random.Random(f"broker {seed}")
    drone, customer = cast.stage.rogue, rogues.customer
    logins = (
        (drone.mqtt.user_name, drone.mqtt.password),
        (customer.mqtt_user_name, customer.mqtt_password),
    )
    payloads = extreme_payloads(drone, chance, missions=cast.stage.journals.mission_ids())
    names = _topic_names(cast, chance)
    while True:
        for user_name, password in logins:
            async with AsyncExitStack() as opened:
                with suppress(TimeoutError, MqttUnavailable):
                    client = await opened.enter_async_context(
                        MqttClient(
                            cast.running.system.mqtt_url,
                            client_id=user_name,
                            user_name=user_name,
                            password=password,
                        )
                    )
                    async with asyncio.timeout(_CONNECTS_WITHIN_S):
                        await client.wait_connected()
                    await _publish(client, names, payloads, answers, chance)


async def _publish(
    client: MqttClient,
    names: Iterator[str],
    payloads: Iterator[bytes],
    answers: Answers,
    chance: random.Random,
) -> None:
    for _ in range(50):
        payload = next(payloads) if chance.random() < 0.8 else chance.choice(UNREADABLE)
        with suppress(ValueError):  # the client itself refuses some names
            await client.publish_raw(
                next(names), payload, mqtt_qos=chance.choice((0, 1)), retained=chance.random() < 0.2
            )
        answers.messages += 1
        await asyncio.sleep(_BETWEEN_MESSAGES_S)


def _topic_names(cast: Cast, chance: random.Random) -> Iterator[str]:
    """Mostly the drone's own topics, some of others, and some that nobody has."""
    topics = (ACKS, EVENTS, STATE, TELEMETRY, CONNECTION)
    while True:
        kind = chance.random()
        drone = cast.stage.rogue if kind < 0.8 else chance.choice(cast.stage.drones)
        provider_id = cast.stage.rogue.provider_id if kind < 0.9 else drone.provider_id
        name = chance.choice(topics)(provider_id, drone.drone_id).name
        yield name if kind < 0.95 else f"skyway/{extreme_text(chance)[:200]}"
