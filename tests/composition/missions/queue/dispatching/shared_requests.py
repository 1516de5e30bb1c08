"""Requests of customers who may share a trip, and what is reported to each of them."""

from typing import Any

from skyway_composition.missions.booking.book import SharedTrips

from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.request import DeliveryRequest
from tests.composition.busy_world import BusyWorld


def asks(
    *to: str,
    wait_s: float = 1200.0,
    mass_kg: float = 0.4,
    pickup: str = "a",
    within_m: float = 0.0,
    may_be_later_s: float = 0.0,
    **members: Any,
) -> DeliveryRequest:
    """A request from a that may be pooled; all customers name their packages p1, p2, ..."""
    pooling = {
        "pooling": True,
        "pooling_wait_s": wait_s,
        "pickup_within_m": within_m,
        "may_be_later_s": may_be_later_s,
    }
    return DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": pickup},
            "packages": [
                {"package_id": f"p{n}", "mass_kg": mass_kg, "destination": {"station_id": each}}
                for n, each in enumerate(to, 1)
            ],
            "qos": {"objective": "CHEAPEST", **pooling},
            **members,
        }
    )


def finder_of(world: BusyWorld) -> SharedTrips:
    """What finds shared trips in this world."""
    assert world.bookings.shared is not None
    return world.bookings.shared


def packages_named(reports: list[MissionReport]) -> set[str]:
    """All packages that the reports name."""
    return {
        package_id
        for each in reports
        for package_id in (
            *each.package_ids,
            *each.stranded_package_ids,
            *(eta.package_id for eta in each.etas),
            *each.data.get("mass_kg", {}),
            *(eta.package_id for eta in (each.mission.packages if each.mission else ())),
            *(one.package_id for one in (each.mission.plan.deliveries if each.mission else ())),
        )
    }
