from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from pydantic import ValidationError

from skyway.delivery.qos import ProviderChoice, QoS
from skyway.delivery.request import DeliveryRequest
from skyway.ids import PackageId, ProviderId

ASKED_AT = datetime(2026, 3, 1, 12, tzinfo=UTC)


WINDOW = {"not_before_at": ASKED_AT, "latest_at": ASKED_AT + timedelta(hours=1)}


def make_request(**changes: Any) -> dict[str, Any]:
    return {
        "pickup": {"station_id": "a"},
        "packages": [make_package()],
        **changes,
    }


def make_package(
    package_id: str = "p1", mass_kg: object = 1.0, destination: str = "b"
) -> dict[str, Any]:
    place = {"station_id": destination}
    return {"package_id": package_id, "mass_kg": mass_kg, "destination": place}


@pytest.mark.parametrize(
    ("changes", "field", "limit"),
    [
        ({"packages": []}, "packages", "at least one"),
        ({"packages": [make_package(f"p{n}") for n in range(101)]}, "packages", "100"),
        ({"packages": [make_package(), make_package()]}, "packages", "'p1' is given 2 times"),
        (
            {"packages": [make_package(f"p{n}", destination=f"d{n}") for n in range(49)]},
            "packages",
            "limit of 48",
        ),
        ({"packages": [make_package(mass_kg=-0.1)]}, "packages.0.mass_kg", "equal to 0"),
        ({"packages": [make_package(mass_kg=1001)]}, "packages.0.mass_kg", "1000"),
        ({"packages": [make_package(mass_kg=float("nan"))]}, "packages.0.mass_kg", "finite"),
        ({"packages": [make_package(mass_kg=True)]}, "packages.0.mass_kg", "valid number"),
        ({"packages": [make_package(mass_kg="1")]}, "packages.0.mass_kg", "valid number"),
        ({"pickup": {"station_id": "no spaces"}}, "pickup.station_id", "pattern"),
        ({"qos": {"objective": "soonest"}}, "qos.objective", "FASTEST"),
        ({"qos": {"objective": "FASTEST", "weights": {"time": 1}}}, "qos", "exclude"),
        ({"qos": {"weights": {"time": 0}}}, "qos.weights", "above 0"),
        ({"qos": {"providers": {"pinned": "x", "denied": ["x"]}}}, "qos.providers", "denied"),
        ({"colour": "red"}, "colour", "not permitted"),
    ],
)
def test_a_bad_request_names_its_field_and_limit(
    changes: dict[str, Any], field: str, limit: str
) -> None:
    with pytest.raises(ValidationError) as refused:
        DeliveryRequest.model_validate(make_request(**changes))

    faults = refused.value.errors()
    assert [".".join(map(str, fault["loc"])) for fault in faults] == [field]
    assert limit in faults[0]["msg"]


def test_destinations_are_distinct_and_in_order() -> None:
    packages = [
        make_package("p1", 1.0, "c"),
        make_package("p2", 2.0, "b"),
        make_package("p3", 0, "c"),
    ]

    request = DeliveryRequest.model_validate(make_request(packages=packages))

    assert request.destinations == ("c", "b")
    assert request.payload_kg == 3.0


@pytest.mark.parametrize(
    ("choice", "is_admitted"),
    [
        ({}, True),
        ({"pinned": "x"}, True),
        ({"pinned": "y"}, False),
        ({"allowed": ["y"]}, False),
        ({"allowed": []}, False),
        ({"denied": ["x"]}, False),
    ],
)
def test_a_provider_is_admitted_as_chosen(choice: dict[str, Any], is_admitted: bool) -> None:
    chosen = ProviderChoice.model_validate(choice)

    assert chosen.admits(ProviderId("x")) is is_admitted


def test_the_default_objective_is_the_fastest() -> None:
    ranking = QoS().ranking

    assert (ranking.time, ranking.price, ranking.energy) == (1.0, 0.0, 0.0)


def test_a_wait_for_others_needs_pooling() -> None:
    with pytest.raises(ValidationError, match="pooling_wait_s needs pooling"):
        QoS(pooling_wait_s=60.0)


def test_another_pickup_needs_pooling_and_has_a_furthest_distance() -> None:
    with pytest.raises(ValidationError, match="pickup_within_m needs pooling"):
        QoS(pickup_within_m=1.0)
    with pytest.raises(ValidationError, match="less than or equal to 5000"):
        QoS(pooling=True, pickup_within_m=5_001.0)


@pytest.mark.parametrize(
    ("changes", "starts_at"),
    [
        ({}, ASKED_AT + timedelta(minutes=10)),
        ({"earliest_pickup_at": "2026-03-01T12:05:00Z"}, ASKED_AT + timedelta(minutes=10)),
        ({"earliest_pickup_at": "2026-03-01T14:00:00Z"}, ASKED_AT + timedelta(hours=2)),
        ({"latest_pickup_at": "2026-03-01T15:00:00Z"}, None),
        ({"qos": {"pooling": True}}, None),
    ],
    ids=["waits", "waits longer than asked", "asked for later", "has a window", "does not wait"],
)
def test_a_request_that_waits_for_others_begins_later(
    changes: dict[str, Any], starts_at: datetime | None
) -> None:
    qos = {"pooling": True, "pooling_wait_s": 600}
    request = DeliveryRequest.model_validate(make_request(**{"qos": qos, **changes}))

    assert request.begun_after_wait(ASKED_AT).earliest_pickup_at == starts_at


@pytest.mark.parametrize(
    ("windows", "promised_min", "kept_min"),
    [
        ({}, 70, 70),
        ({"pickup": (None, 30)}, 70, 70),
        ({"pickup": (0, None)}, 70, 70),
        # A shop's hours at the pickup say nothing of when packages may come.
        ({"pickup": (0, 30)}, 70, 70),
        ({"pickup": (0, 30), "may_be_later_s": 600}, 70, 80),
        ({"may_be_later_s": 3_600, "deadline": 90}, 70, 90),
        ({"may_be_later_s": 3_600, "deadline": 60}, 70, 70),
        ({"package": (60, 90), "deadline": 80}, 70, 80),
        ({"package": (None, 90)}, 70, 70),
        ({"package": (60, 90)}, 60, 90),
        ({"package": (60, 90)}, 85, 90),
        ({"package": (60, 90)}, 95, 95),
        ({"package": (60, 90), "may_be_later_s": 3_600}, 70, 90),
        ({"package": (60, 90), "pickup": (0, 120)}, 70, 90),
    ],
)
def test_a_promise_is_kept_until_the_end_of_the_window(
    windows: dict[str, Any], promised_min: float, kept_min: float
) -> None:
    def at(minutes: float | None) -> datetime | None:
        return None if minutes is None else ASKED_AT + timedelta(minutes=minutes)

    pickup, package = (windows.get(name, (None, None)) for name in ("pickup", "package"))
    window = {"not_before_at": at(package[0]), "latest_at": at(package[1])}
    request = DeliveryRequest.model_validate(
        make_request(
            earliest_pickup_at=at(pickup[0]),
            latest_pickup_at=at(pickup[1]),
            packages=[{**make_package(), **window}, make_package("p2")],
            qos={
                "deadline_at": at(windows.get("deadline")),
                "may_be_later_s": windows.get("may_be_later_s", 0),
            },
        )
    )
    promised_at = ASKED_AT + timedelta(minutes=promised_min)

    assert request.kept_until(PackageId("p1"), promised_at) == at(kept_min)


@pytest.mark.parametrize(
    ("changes", "qos", "weight"),
    [
        ({}, {}, 1.0),
        ({}, {"priority": "PRIORITY"}, 2.0),
        ({"earliest_pickup_at": ASKED_AT, "latest_pickup_at": ASKED_AT}, {}, 1.0),
        ({"packages": [{**make_package(), "latest_at": ASKED_AT}]}, {}, 1.0),
        ({}, {"may_be_later_s": 600}, 1.0),
        ({"packages": [{**make_package(), **WINDOW}]}, {"priority": "PRIORITY"}, 0.2),
        ({"packages": [{**make_package(), **WINDOW}, make_package("p2")]}, {}, 1.0),
    ],
)
def test_a_second_of_a_delivery_counts_little_if_its_window_is_promised(
    changes: dict[str, Any], qos: dict[str, Any], weight: float
) -> None:
    request = DeliveryRequest.model_validate(make_request(qos=qos, **changes))

    assert request.weight == pytest.approx(weight)
