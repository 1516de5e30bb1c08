"""The promised moments of a package."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_gateway.lateness.promise import due_of

from skyway.delivery.qos import QoS


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

    assert due_of(at(5), at(8), QoS.model_validate(asked)) == at(due_min)
