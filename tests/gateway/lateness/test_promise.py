"""The promised moments of a package."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_gateway.lateness.lateness_forecast import due_of, host_delay

from skyway.delivery.request import DeliveryRequest
from skyway.ids import PackageId
from skyway.runtime.clock import ManualClock


@pytest.mark.parametrize(
    ("qos", "due_min"),
    [
        ({}, 8),
        ({"promise": "P50"}, 5),
        ({"may_be_later_s": 600}, 18),
        ({"promise": "P50", "may_be_later_s": 600}, 15),
        ({"may_be_later_s": 600, "deadline_min": 12}, 12),
        ({"may_be_later_s": 600, "deadline_min": 6}, 8),
    ],
)
def test_lateness_counts_from_the_promise_and_from_what_the_customer_allows(
    qos: dict[str, Any], due_min: float
) -> None:
    def at(minutes: float) -> datetime:
        return datetime(2026, 3, 1, 12, tzinfo=UTC) + timedelta(minutes=minutes)

    asked = {name: value for name, value in qos.items() if name != "deadline_min"}
    if "deadline_min" in qos:
        asked["deadline_at"] = at(qos["deadline_min"])

    request = DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": "a"},
            "packages": [{"package_id": "p1", "mass_kg": 1, "destination": {"station_id": "b"}}],
            "qos": asked,
        }
    )
    assert due_of(PackageId("p1"), at(5), at(8), request) == at(due_min)


@pytest.mark.parametrize(("rate", "delay_s"), [(0.5, 0), (1, 0), (2, 5), (61, 300)])
def test_the_machine_causes_lateness_only_where_fleet_time_is_fast(
    rate: float, delay_s: float
) -> None:
    clock = ManualClock(datetime(2026, 3, 1, 12, tzinfo=UTC), rate)

    assert host_delay(clock) == timedelta(seconds=delay_s)
