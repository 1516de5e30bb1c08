"""Requests of customers who may share a trip, and what is reported to each of them."""

from typing import Any

from skyway.contracts.mission_reports import MissionReport
from skyway.delivery.request import DeliveryRequest


def asks(*to: str, wait_s: float = 1200.0, mass_kg: float = 0.4, **members: Any) -> DeliveryRequest:
    """A request from a that may be pooled; all customers name their packages p1, p2, ..."""
    return DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": "a"},
            "packages": [
                {"package_id": f"p{n}", "mass_kg": mass_kg, "destination": {"station_id": each}}
                for n, each in enumerate(to, 1)
            ],
            "qos": {"objective": "cheapest", "pooling": True, "pooling_wait_s": wait_s},
            **members,
        }
    )


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
