"""Stories of drones that lie to be paid: nothing is delivered, and people are notified."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping, Sequence
from typing import Any, Final

from skyway_lab.benchmarks.chaos.cast import Cast
from skyway_lab.benchmarks.chaos.judgement import Flaw
from skyway_lab.benchmarks.hostile.liar import Liar, lying

from skyway.cli.gateway import GatewayApi
from skyway.contracts.flight_step import DeliverStep, PickUpStep
from skyway.contracts.instruction import MissionInstruction
from skyway.geo import Position
from skyway.ids import DeliveryId, StationId

#: Wall seconds within which people must be notified of a lie, and between two looks.
_SEEN_WITHIN_S: Final = 60.0
_LOOK_EVERY_S: Final = 0.2

#: What a drone says of a mission that it was sent.
Story = Callable[[Liar, MissionInstruction], Awaitable[None]]


async def cut_flights(liar: Liar, mission: MissionInstruction) -> None:
    """It loads, and says that its flights were cut short; then it delivers."""
    await liar.answer(mission, "ACCEPTED")
    for step in _up_to_delivery(mission):
        is_on_the_way = not isinstance(step, PickUpStep | DeliverStep)
        data = _load(mission) if isinstance(step, DeliverStep) else {}
        await liar.end(mission, step, code="CUT" if is_on_the_way else None, data=data)


async def never_loaded(liar: Liar, mission: MissionInstruction) -> None:
    """It loads something else, and delivers all the same."""
    await liar.answer(mission, "ACCEPTED")
    for step in _up_to_delivery(mission):
        taken = ("another",) if isinstance(step, PickUpStep) else ()
        await liar.end(mission, step, package_ids=taken, data=_load(mission))


async def proof_that_is_no_number(liar: Liar, mission: MissionInstruction) -> None:
    """It weighs its load with numbers that are none."""
    await liar.answer(mission, "ACCEPTED")
    for step in _up_to_delivery(mission):
        nothing = {"load_before_kg": float("nan"), "load_after_kg": float("inf")}
        await liar.end(mission, step, data=nothing if isinstance(step, DeliverStep) else {})


async def late_hand_over(liar: Liar, mission: MissionInstruction) -> None:
    """It refuses its mission, and says later that it has delivered."""
    await liar.answer(mission, "REJECTED", code="NOT_AT_START")
    await liar.end(mission, _up_to_delivery(mission)[-1], data=_load(mission))


async def creep(liar: Liar, _mission: MissionInstruction) -> None:
    """It moves by 300 km in each of many states, and charges."""
    for number in range(1, 40):
        east = 3.0 * (number % 50)
        place = Position(liar.home.longitude_deg + east, liar.home.latitude_deg)
        await liar.stand(place, soc=min(1.0, 0.5 + number / 80))
        await asyncio.sleep(0.05)


async def alarms_of_ours(liar: Liar, _mission: MissionInstruction) -> None:
    """It opens alarms that only the cloud may open."""
    for code in ("SENDER_PUT_OUT", "FORGED_MESSAGES", "IMPLAUSIBLE", "DRONE_JUMPED"):
        await liar.report("ALARM", code=code, level="CRITICAL")


#: Each story with the alarms or reasons of the quarantine by which people learn of the lie.
STORIES: Final[Mapping[Story, Sequence[str]]] = {
    cut_flights: ("MISSION_IN_DOUBT",),
    never_loaded: ("MISSION_IN_DOUBT",),
    proof_that_is_no_number: ("UNREADABLE", "MISSION_IN_DOUBT"),
    late_hand_over: ("LATE_HAND_OVER", "IMPLAUSIBLE"),
    creep: ("DRONE_JUMPED",),
    alarms_of_ours: ("ALARM",),
}


async def stories_played(cast: Cast) -> list[Flaw]:
    """Let all stories happen together; the flaws are lies that were believed, or hidden."""
    async with GatewayApi(cast.running.system.urls["gateway"]) as api:
        subject = {"role": "customer", "subject_id": "stories"}
        issued = await api.call("POST", "/v1/keys", key=cast.operator_key, body=subject)
        homes = cast.city.network.columns.station_ids
        found = await asyncio.gather(
            *(
                _flaws_of(cast, api, story, home=StationId(home), customer_key=issued["key"])
                for story, home in zip(STORIES, homes, strict=False)
            )
        )
    return [flaw for flaws in found for flaw in flaws]


async def _flaws_of(
    cast: Cast, api: GatewayApi, story: Story, *, home: StationId, customer_key: str
) -> list[Flaw]:
    async with lying(cast, api, home=home) as liar:
        delivery_id = await _requested(cast, api, liar, customer_key=customer_key)
        try:
            async with asyncio.timeout(_SEEN_WITHIN_S):
                await story(liar, await liar.mission())
                while not await _is_known(cast, api, liar, STORIES[story]):  # noqa: ASYNC110 - other processes notify
                    await asyncio.sleep(_LOOK_EVERY_S)
        except TimeoutError:
            return [Flaw("hidden lie", delivery_id, f"{story.__name__}: nobody was notified")]
    shown = await api.call("GET", f"/v1/deliveries/{delivery_id}", key=customer_key)
    states = [shown["state"], *(each["state"] for each in shown["packages"])]
    if {"COMPLETED", "PARTIALLY_COMPLETED", "DELIVERED"} & {*states}:
        return [Flaw("believed lie", delivery_id, f"{story.__name__}: {states}")]
    return []


async def _requested(cast: Cast, api: GatewayApi, liar: Liar, *, customer_key: str) -> DeliveryId:
    """A delivery that only the liar may fly."""
    home = liar.drone.home_station_id
    body = {
        "pickup": {"station_id": home},
        "packages": [
            {
                "package_id": "p1",
                "mass_kg": 1.0,
                "destination": {"station_id": cast.city.near[home][-1]},
            }
        ],
        "qos": {"providers": {"allowed": [liar.drone.provider_id]}},
    }
    accepted = await api.call("POST", "/v1/deliveries", key=customer_key, body=body)
    return DeliveryId(accepted["delivery_id"])


async def _is_known(cast: Cast, api: GatewayApi, liar: Liar, signs: Sequence[str]) -> bool:
    """Whether an alarm or a set-aside message of the liar's provider is such a sign."""
    query = f"provider_id={liar.drone.provider_id}"
    alarms = await api.call("GET", f"/v1/alarms?{query}", key=cast.operator_key)
    kept = await api.call("GET", f"/v1/quarantine?{query}", key=cast.operator_key)
    seen = {each["code"] for each in alarms["items"]}
    seen |= {each["reason"] for each in kept["items"]}
    return not seen.isdisjoint(signs)


def _up_to_delivery(mission: MissionInstruction) -> list[Any]:
    """The steps of a mission up to its first delivery."""
    kinds = [each.kind for each in mission.steps]
    return list(mission.steps[: kinds.index("DELIVER") + 1])


def _load(mission: MissionInstruction) -> dict[str, float]:
    """What an honest drone would weigh before and after it hands over all packages."""
    mass_kg = sum(
        package.mass_kg
        for step in mission.steps
        if isinstance(step, PickUpStep)
        for package in step.packages
    )
    return {"load_before_kg": mass_kg, "load_after_kg": 0.0}
