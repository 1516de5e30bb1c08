"""A chain of missions on the first drone of a busy world, and what was reported about them."""

from collections import Counter
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, Final

from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId
from tests.composition.busy_world import BusyWorld
from tests.composition.drone_journals import handed_over

#: The pickup and the destination of each delivery; each begins where the one before ends.
CHAIN: Final = {
    "dlv1": ("a", "b"),
    "dlv2": ("b", "c"),
    "dlv3": ("c", "a"),
    "dlv4": ("a", "b"),
    "dlv5": ("b", "a"),
}


def request(
    delivery_id: str,
    pickup: str,
    *to: str,
    proof: object = None,
    window: Mapping[str, datetime] | None = None,
    **members: Any,
) -> DeliveryRequest:
    """One package of 400 g for each destination; all need this proof and have this window."""
    return DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": pickup},
            "packages": [
                {
                    "package_id": f"{delivery_id}_{number}",
                    "mass_kg": 0.4,
                    "destination": {"station_id": each},
                    "dropoff_verification": proof,
                    **(window or {}),
                }
                for number, each in enumerate(to, 1)
            ],
            **members,
        }
    )


async def book(
    world: BusyWorld, delivery_id: str, pickup: str, *to: str, drone: int = 1, **members: Any
) -> str:
    """Book one drone, the first unless another is named; returns the outcome."""
    outcome = await world.book(
        delivery_id,
        request(delivery_id, pickup, *to, **members),
        loading="AUTOMATIC",
        drones=world.drones[drone - 1 : drone],
    )
    await world.keep_calendars()
    return outcome


async def book_chain(world: BusyWorld, length: int = len(CHAIN)) -> None:
    """Book the first deliveries of the chain on the first drone."""
    for delivery_id in [*CHAIN][:length]:
        assert await book(world, delivery_id, *CHAIN[delivery_id]) == "BOOKED"


async def reports_of(world: BusyWorld, delivery_id: str) -> list[MissionReport]:
    return [each for each in await world.reports() if each.delivery_id == DeliveryId(delivery_id)]


async def kinds_of(world: BusyWorld, delivery_id: str) -> Counter[str]:
    """How often each kind of report was sent about a delivery."""
    return Counter(each.kind for each in await reports_of(world, delivery_id))


async def waiting(world: BusyWorld) -> list[str]:
    """The deliveries whose missions are QUEUED, in the order of their starts."""
    return [
        str(each.mission.delivery_id)
        for each in await world.planned()
        if each.mission.state == "QUEUED"
    ]


async def etas(world: BusyWorld) -> dict[str, datetime]:
    """The promised arrival of the first package of each delivery that is not over."""
    return {
        str(each.mission.delivery_id): each.mission.packages[0].eta_at
        for each in await world.planned()
    }


async def pass_minutes(world: BusyWorld, minutes: float) -> None:
    """Let time pass and check that no rule is broken."""
    await world.pass_time(timedelta(minutes=minutes))
    await world.check()


def delivered_by(world: BusyWorld, drone: int = 1) -> list[str]:
    """The deliveries whose packages a drone has handed over, in order."""
    return [each for each, _ in handed_over(world.drones[drone - 1 : drone])]
