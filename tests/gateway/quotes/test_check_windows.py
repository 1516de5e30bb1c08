"""Windows that nobody can meet are refused, with their field, their limit and by how much."""

from datetime import UTC, datetime
from typing import Any

import pytest
from skyway_gateway.quotes.check_request import check_windows

from skyway.delivery.request import DeliveryRequest
from skyway.errors import InvalidInput

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)


def make_request(*packages: dict[str, str], **members: Any) -> DeliveryRequest:
    """A request with a package to b for each of these windows; hours without a date are today."""
    asked = [
        {"package_id": f"p{number}", "mass_kg": 1, "destination": {"station_id": "b"}, **window}
        for number, window in enumerate(packages)
    ]
    document = {"pickup": {"station_id": "a"}, "packages": asked, **members}
    return DeliveryRequest.model_validate(document)


def at(hour: int, day: int = 1, month: int = 3) -> str:
    return datetime(2026, month, day, hour, tzinfo=UTC).isoformat()


def test_windows_that_can_be_met_pass() -> None:
    window = {"not_before_at": at(14), "latest_at": at(15)}

    check_windows(
        make_request(
            window, window, {}, earliest_pickup_at=at(10), latest_pickup_at=at(14),
            qos={"deadline_at": at(16)},
        ),
        now=NOW,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("packages", "members", "field", "detail"),
    [
        (
            [{"not_before_at": at(15), "latest_at": at(14)}],
            {},
            "packages.0.latest_at",
            "is before packages.0.not_before_at",
        ),
        (
            [{}, {"latest_at": at(11)}],
            {},
            "packages.1.latest_at",
            "is in the past: fleet time is 2026-03-01T12:00",
        ),
        ([{}], {"latest_pickup_at": at(12)}, "latest_pickup_at", "is in the past: fleet time is"),
        (
            [{}],
            {"earliest_pickup_at": at(16), "latest_pickup_at": at(14)},
            "latest_pickup_at",
            "is before earliest_pickup_at",
        ),
        (
            [{"not_before_at": at(13, day=1, month=4)}],
            {},
            "packages.0.not_before_at",
            "later than the limit of 2026-03-31T12:00:00.000Z, 30 days ahead",
        ),
        ([{"latest_at": at(13, month=5)}], {}, "packages.0.latest_at", "later than the limit"),
        (
            [{"not_before_at": at(18)}],
            {"qos": {"deadline_at": at(15)}},
            "packages.0.not_before_at",
            "is after the deadline",
        ),
        (
            [{"latest_at": at(14)}],
            {"earliest_pickup_at": at(15)},
            "packages.0.latest_at",
            "is before earliest_pickup_at",
        ),
        (
            [{"latest_at": at(14)}, {"not_before_at": at(15)}],
            {},
            "packages.0.latest_at",
            "both go to 'b' and are handed over together; ask for them in two requests",
        ),
    ],
)
def test_a_window_that_cannot_be_met_is_named(
    packages: list[dict[str, str]], members: dict[str, Any], field: str, detail: str
) -> None:
    with pytest.raises(InvalidInput) as raised:
        check_windows(make_request(*packages, **members), now=NOW)

    assert raised.value.faults[0].field == field
    assert detail in raised.value.faults[0].detail


@pytest.mark.parametrize(
    ("packages", "members", "field", "takes_s"),
    [
        (
            [{"not_before_at": at(14), "latest_at": "2026-03-01T14:00:29Z"}],
            {},
            "packages.0.latest_at",
            30,
        ),
        (
            [{}],
            {"earliest_pickup_at": at(14), "latest_pickup_at": "2026-03-01T14:00:29Z"},
            "latest_pickup_at",
            60,
        ),
    ],
)
def test_a_window_that_is_shorter_than_what_it_holds_is_named(
    packages: list[dict[str, str]], members: dict[str, Any], field: str, takes_s: float
) -> None:
    with pytest.raises(InvalidInput) as raised:
        check_windows(make_request(*packages, **members), now=NOW, loading_s=60, dropoff_s=30)

    assert raised.value.faults[0].field == field
    assert "29 s after" in raised.value.faults[0].detail
    assert f"shorter than the {takes_s} s" in raised.value.faults[0].detail
