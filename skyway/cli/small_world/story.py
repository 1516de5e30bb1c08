"""The story of the day: a station that closes and opens again, a gust, a drone that is late.

Everything is done by calls that an operator may make, so the console shows it by its usual means.
"""

from collections import Counter
from collections.abc import Awaitable, Callable, Collection
from datetime import datetime, timedelta
from itertools import cycle
from pathlib import Path
from random import Random
from typing import Any, Final, Never

import httpx

from skyway.cli.demo.fleets import NETWORK_ID
from skyway.cli.gateway import GatewayApi
from skyway.cli.small_world.gust import GUST_MPS, calm, passing_gust
from skyway.cli.small_world.shops import OWN_SHOP, SHOPS
from skyway.errors import SkywayError
from skyway.ids import StationId
from skyway.network.network import Network
from skyway.runtime.clock import FleetClock

#: Between two chapters of the story, and how long a closure, a gust and a delay last, fleet time.
PAUSE: Final = timedelta(minutes=60)
_CLOSED_FOR: Final = timedelta(minutes=40)
_GUST_LASTS: Final = timedelta(minutes=40)
_HELD_FOR: Final = timedelta(minutes=15)

#: If nothing is under way that a chapter can be about, it is tried again after this time; the next
#: chapter comes after so many tries.
_AGAIN_AFTER: Final = timedelta(minutes=10)
_MOST_TRIES: Final = 12

_REASONS: Final = ("a crane is being moved", "fireworks are prepared", "a helicopter lands nearby")
_HOLD_REASON: Final = "people look at a propeller"

#: A closure may give so many missions a new plan, and is chosen from so many places.
_MOST_AFFECTED: Final = 3
_PLACES_TRIED: Final = 10

_Json = dict[str, Any]  # as the gateway answers


class StoryOfTheDay:
    """Has something happen again and again; `say` gets a line for what begins and what ends."""

    def __init__(
        self,
        api: GatewayApi,
        network: Network,
        *,
        operator_key: str,
        provider_ids: Collection[str],
        clock: FleetClock,
        chance: Random,
        held_file: Path,
        say: Callable[[str], None],
    ) -> None:
        self._api = api
        self._network = network
        self._operator_key = operator_key
        #: Whose drones the story is about: those of other providers are left alone.
        self._provider_ids = provider_ids
        self._clock = clock
        self._chance = chance
        #: The mission that the story holds, so that a later start lets it go on.
        self._held_file = held_file
        self._say = say

    async def run(self) -> Never:
        """Begin with calm air, then have one chapter happen after the other; never returns."""
        while not await self._has_happened(self._begin):
            await self._pause(_AGAIN_AFTER)
        await self._pause(PAUSE)
        for chapter in cycle((self.close_on_the_way, self.delay_a_drone, self.let_a_gust_pass)):
            for _ in range(_MOST_TRIES):
                if await self._has_happened(chapter):
                    await self._pause(PAUSE)
                    break
                await self._pause(_AGAIN_AFTER)
        raise AssertionError("a cycle has no end")

    async def _has_happened(self, chapter: Callable[[], Awaitable[bool]]) -> bool:
        """Whether the chapter could happen now; in trouble it is tried again later."""
        try:
            return await chapter()
        except (SkywayError, httpx.HTTPError) as trouble:
            self._say(f"The story of the day goes on later: {trouble}")
            return False

    async def _begin(self) -> bool:
        """Calm air, and no drone that an earlier start has left held."""
        await self._forecast(calm(self._network, self._clock.now()))
        await self._resume()
        return True

    async def close_on_the_way(self) -> bool:
        """Close a place on the way of a few drones until a moment; whether there was one."""
        reason = self._chance.choice(_REASONS)
        for place, path in (await self._places_on_ways())[:_PLACES_TRIED]:
            until = self._clock.now() + _CLOSED_FOR
            body = {"until": until.isoformat(), "reason": reason}
            tried = await self._call("POST", f"{path}?dry_run=true", body)
            if not 1 <= len(tried["affected_missions"]) <= _MOST_AFFECTED:
                continue
            made = await self._call("POST", path, body)
            count = len(made["affected_missions"])
            self._say(
                f"{self._time()}: {place} is closed until {until:%H:%M}: {reason}. "
                f"Flights that need a new plan: {count}."
            )
            await self._clock.sleep_until(until)
            self._say(f"{self._time()}: {place} is open again.")
            return True
        return False

    async def _places_on_ways(self) -> list[tuple[str, str]]:
        """Stations and segments on the ways of drones: their names, and where they are closed."""
        stations = [
            (self._name(each), f"/v1/stations/{each}/closures")
            for each in await self._passed_stations()
        ]
        steps = [step for mission in await self._flown() for step in mission["plan"]["steps"]]
        segments = dict.fromkeys(
            (step["from"], step["to"]) for step in steps if step["kind"] == "FLY"
        )
        return stations + [
            (
                f"The way from {self._name(start)} to {self._name(end)}",
                f"/v1/segments/{start}/{end}/closures",
            )
            for start, end in segments
        ]

    async def delay_a_drone(self) -> bool:
        """Hold a drone at its next landing, and let it go on; whether there was one."""
        await self._resume()
        for delivery in await self._in_progress():
            mission = delivery["missions"][-1]
            path = f"/v1/missions/{mission['mission_id']}/commands"
            body = {"command": "HOLD", "reason": _HOLD_REASON}
            tried = await self._call("POST", f"{path}?dry_run=true", body)
            landing = tried["outlook"]["next_landing"]
            if landing is None or mission["is_held"]:
                continue
            drone = await self._drone_name(mission)
            self._held_file.write_text(mission["mission_id"])
            await self._call("POST", path, body)
            self._say(
                f"{self._time()}: {drone} lands at {self._name(landing['station_id'])} and waits "
                f"{_HELD_FOR.seconds // 60} min, people look at a propeller. "
                f"{delivery['reference']} comes later."
            )
            await self._clock.sleep_until(datetime.fromisoformat(landing["at"]) + _HELD_FOR)
            await self._resume()
            self._say(f"{self._time()}: {drone} flies on.")
            return True
        return False

    async def _resume(self) -> None:
        """Let the held drone go on, if there is one and its mission has not ended."""
        if not self._held_file.exists():
            return
        path = f"/v1/missions/{self._held_file.read_text()}"
        mission = (await self._call("GET", path))["mission"]
        if mission["is_held"] and mission["state"] == "ACTIVE":
            body = {"command": "RESUME", "reason": "the propeller is fine"}
            await self._call("POST", f"{path}/commands", body)
        self._held_file.unlink()

    async def let_a_gust_pass(self) -> bool:
        """Let a gust cross the ways of some drones; whether a drone is under way."""
        missions = await self._flown()
        if not missions:
            return False
        steps = missions[0]["plan"]["steps"]
        last = next(step["station_id"] for step in reversed(steps) if step["kind"] == "DELIVER")
        centre = self._network.stations[StationId(last)]
        begins_at = self._clock.now()
        await self._forecast(passing_gust(self._network, begins_at, centre.position, _GUST_LASTS))
        self._say(
            f"{self._time()}: gusts of {GUST_MPS:g} m/s near {self._name(last)}, moving to "
            f"the southeast until {begins_at + _GUST_LASTS:%H:%M}. Drones keep out of them."
        )
        await self._clock.sleep_until(begins_at + _GUST_LASTS)
        await self._forecast(calm(self._network, self._clock.now()))
        self._say(f"{self._time()}: the air is calm again.")
        return True

    async def _in_progress(self) -> list[_Json]:
        """The deliveries that the providers have in the air, in a random order."""
        page = await self._call("GET", "/v1/deliveries?state=IN_PROGRESS&limit=50")
        found = [
            each
            for each in page["items"]
            if each["missions"] and each["missions"][-1]["provider_id"] in self._provider_ids
        ]
        self._chance.shuffle(found)
        return found

    async def _flown(self) -> list[_Json]:
        """The missions of the deliveries in progress."""
        return [each["missions"][-1] for each in await self._in_progress()]

    async def _passed_stations(self) -> list[StationId]:
        """Stations that drones pass and no delivery begins or ends at, the most passed first."""
        steps = [step for mission in await self._flown() for step in mission["plan"]["steps"]]
        ends = {step.get("station_id") for step in steps} | {
            each for shop in (OWN_SHOP, *SHOPS.values()) for each in shop.stations
        }
        passed = Counter(
            StationId(step["to"])
            for step in steps
            if step["kind"] == "FLY" and step["to"] not in ends
        )
        return [station_id for station_id, _ in passed.most_common()]

    async def _forecast(self, forecast: _Json) -> None:
        await self._call("PUT", f"/v1/networks/{NETWORK_ID}/weather", forecast)

    async def _drone_name(self, mission: _Json) -> str:
        path = f"/v1/providers/{mission['provider_id']}/drones/{mission['drone_id']}"
        drone = await self._call("GET", path)
        return str(drone["name"] or drone["drone_id"])

    async def _call(self, method: str, path: str, body: object = None) -> Any:
        """The gateway's answer as JSON."""
        return await self._api.call(method, path, key=self._operator_key, body=body)

    async def _pause(self, span: timedelta) -> None:
        await self._clock.sleep_until(self._clock.now() + span)

    def _time(self) -> str:
        return f"{self._clock.now():%H:%M}"

    def _name(self, station_id: str) -> str:
        station = self._network.stations[StationId(station_id)]
        return station.name or station_id.replace("-", " ").title()
