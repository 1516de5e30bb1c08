"""Waits until a local system is ready, and explains a long wait."""

import asyncio
from collections.abc import Callable, Mapping

import httpx

from skyway.cli.system.children import named_broker
from skyway.runtime.mqtt.address import BrokerAddress

#: A wait is explained after this many wall seconds. A service that does not answer at all is
#: named later, because on a slow machine services take longer to start.
_LONG_S, _LONG_TO_START_S = 5.0, 30.0

#: Wall seconds after which a start that goes on says so again.
_GOES_ON_EVERY_S = 4.0

#: What a service lacks that is ready and connected.
_NOTHING = ""

#: Wall seconds between two checks.
_EVERY_S = 0.05

#: How long a service and a broker may take to answer, wall seconds.
_ANSWERS_WITHIN_S = 2.0


async def until_ready(
    urls: Mapping[str, str],
    *,
    say: Callable[[str], None],
    long_s: float = _LONG_S,
    long_to_start_s: float = _LONG_TO_START_S,
    goes_on_every_s: float = _GOES_ON_EVERY_S,
) -> None:
    """Return once all services are ready; in a long wait, `say` gets each reason once.

    Every few seconds `say` also gets which services are not ready yet.
    """
    loop = asyncio.get_running_loop()
    began_s = said_s = loop.time()
    explains_from_s, starts_until_s = loop.time() + long_s, loop.time() + long_to_start_s
    said = set[str]()
    async with httpx.AsyncClient(timeout=_ANSWERS_WITHIN_S) as client:
        while lacks := await _lacks(client, urls):
            if loop.time() >= said_s + goes_on_every_s:
                said_s = loop.time()
                say(f"Starting for {said_s - began_s:.0f} s; not ready yet: {', '.join(lacks)}.")
            if loop.time() >= explains_from_s:
                if loop.time() < starts_until_s:
                    lacks = {name: lack for name, lack in lacks.items() if lack is not None}
                for words in await _in_words(lacks):
                    if words not in said:
                        said.add(words)
                        say(words)
            await asyncio.sleep(_EVERY_S)


async def _lacks(client: httpx.AsyncClient, urls: Mapping[str, str]) -> dict[str, str | None]:
    """The reason of each service that is not ready, in its own words; None without an answer."""
    answers = await asyncio.gather(*(_answer(client, url) for url in urls.values()))
    lacks = {
        name: None if answer is None else _lack(name, answer)
        for name, answer in zip(urls, answers, strict=True)
    }
    return {name: lack for name, lack in lacks.items() if lack != _NOTHING}


async def _answer(client: httpx.AsyncClient, url: str) -> httpx.Response | None:
    try:
        return await client.get(f"{url}/readyz")
    except httpx.HTTPError:
        return None


def _lack(name: str, answer: httpx.Response) -> str | None:
    """What a service says it lacks; None when that cannot be read."""
    try:
        said = answer.json()
        if not answer.is_success:
            return str(said["detail"])
        missing = [part for part, is_there in said["checks"].items() if not is_there]
    except (ValueError, KeyError):
        return None
    return f"{name} has no connection to: {', '.join(missing)}" if missing else _NOTHING


async def _in_words(lacks: Mapping[str, str | None]) -> list[str]:
    words = [
        f"Still waiting: {lack or f'{name} does not answer yet'}." for name, lack in lacks.items()
    ]
    broker = named_broker()
    if broker is not None and any("mqtt" in (lack or "") for lack in lacks.values()):
        words.append(await _trouble_with(broker))
    return words


async def _trouble_with(broker: str) -> str:
    """Why the services are not connected to an external broker."""
    named = f"The broker that SKYWAY_MQTT_URL names, {broker},"
    for address in BrokerAddress.parse_all(broker):
        try:
            async with asyncio.timeout(_ANSWERS_WITHIN_S):
                _, writer = await asyncio.open_connection(address.host, address.port)
        except OSError:
            continue
        writer.close()
        return (
            f"{named} answers, but does not let them in: does it use the accounts of this folder?"
        )
    return (
        f"{named} is not running: start it, or `unset SKYWAY_MQTT_URL`, and Skyway starts"
        " one of its own."
    )
