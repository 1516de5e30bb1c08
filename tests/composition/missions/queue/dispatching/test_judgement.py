"""Whether another order is worth adopting."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import Share
from skyway_composition.missions.queue.dispatching.plan_orders import judge

from skyway.contracts.candidate import Candidate
from skyway.contracts.margins import Margins
from skyway.contracts.mission import Mission, PackageEta
from skyway.delivery.offer import Price
from skyway.delivery.plan import Plan, PlanStatus
from skyway.delivery.request import DeliveryRequest
from skyway.ids import DeliveryId, MissionId, NetworkId, PackageId

_NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def make_record(
    *,
    eta_min: float,
    promised_min: float,
    drone: str = "drn_1",
    energy_kwh: float = 0.0,
    firm_at: datetime | None = None,
    window_min: tuple[float, float] | None = None,
    late_share: float | None = None,
    **qos: Any,
) -> MissionRecord:
    """A waiting mission with one package; minutes count from noon."""

    def etas(minutes: float) -> tuple[PackageEta, ...]:
        eta_at = _NOON + timedelta(minutes=minutes)
        return (PackageEta(package_id=PackageId("p1"), eta_at=eta_at),)

    # The judgement reads only these members.
    members: dict[str, Any] = {
        "mission_id": "msn_1",
        "drone_id": drone,
        "start_at": _NOON,
        "packages": etas(eta_min),
        "firm_at": firm_at,
        "margins": Margins(late_share=late_share),
        "plan": Plan.model_construct(status=PlanStatus.OPTIMAL, energy_j=energy_kwh * 3.6e6),
    }
    mission = Mission.model_construct(**members)
    window = dict(
        zip(
            ("not_before_at", "latest_at"),
            (_NOON + timedelta(minutes=each) for each in window_min or ()),
            strict=False,
        )
    )
    package = {"package_id": "p1", "mass_kg": 1, "destination": {"station_id": "b"}, **window}
    asked = DeliveryRequest.model_validate(
        {"pickup": {"station_id": "a"}, "packages": [package], "qos": qos}
    )
    return MissionRecord(
        mission=mission,
        network_id=NetworkId("city"),
        request=asked,
        candidate=Candidate.model_construct(),  # type: ignore[call-arg]
        expires_ms=0,
        promised=etas(promised_min),
    )


@pytest.mark.parametrize(
    ("saved_min", "drones", "is_better"),
    [(1.0, 1, False), (1.5, 1, True), (1.5, 2, True), (1.0, 2, False)],
)
def test_a_change_must_save_more_than_the_price_of_its_moves(
    saved_min: float, drones: int, is_better: bool
) -> None:
    before = make_record(eta_min=60, promised_min=60)
    after = make_record(eta_min=60 - saved_min, promised_min=60, drone=f"drn_{drones}")

    judgement = judge([(before, after)], tolerance_s=60)

    assert judgement.is_better == is_better
    assert judgement.moves == drones - 1


@pytest.mark.parametrize(
    ("saved_kwh", "later_s", "is_better"), [(0.05, 0, False), (0.1, 0, True), (0.1, 50, False)]
)
def test_a_merge_that_saves_a_flight_is_better_even_if_no_delivery_is_sooner(
    saved_kwh: float, later_s: float, is_better: bool
) -> None:
    before = make_record(eta_min=60, promised_min=60, energy_kwh=0.2)
    after = make_record(eta_min=60 + later_s / 60, promised_min=60, energy_kwh=0.2)
    guest = make_record(eta_min=60, promised_min=60, energy_kwh=saved_kwh)

    judgement = judge([(before, after)], tolerance_s=60, guests=[guest])

    assert judgement.is_better == is_better
    assert judgement.moves == 1


def test_a_second_of_a_priority_delivery_counts_twice() -> None:
    sooner = [
        make_record(eta_min=eta_min, promised_min=60, priority="PRIORITY") for eta_min in (60, 59)
    ]
    later = [make_record(eta_min=eta_min, promised_min=70) for eta_min in (60, 61)]

    judgement = judge([(sooner[0], sooner[1]), (later[0], later[1])], tolerance_s=0)

    assert judgement.saved_s == 60


@pytest.mark.parametrize(
    ("planned_min", "new_min", "is_late"),
    [(60, 61, False), (60, 61.1, True), (70, 70, False), (70, 70.1, True), (50, 61, False)],
)
def test_a_promise_holds_within_the_tolerance_and_a_late_mission_gets_no_later(
    planned_min: float, new_min: float, is_late: bool
) -> None:
    before = make_record(eta_min=planned_min, promised_min=60)
    after = make_record(eta_min=new_min, promised_min=60)

    judgement = judge([(before, after)], tolerance_s=60)

    assert (judgement.late == {"drn_1"}) == is_late


@pytest.mark.parametrize(
    ("qos", "new_min", "is_late"),
    [
        ({"may_be_later_s": 600}, 70, False),
        ({"may_be_later_s": 600}, 70.1, True),
        ({"may_be_later_s": 30}, 61, False),
        ({"may_be_later_s": 600, "deadline_at": _NOON + timedelta(minutes=65)}, 65, False),
        ({"may_be_later_s": 600, "deadline_at": _NOON + timedelta(minutes=65)}, 65.1, True),
    ],
)
def test_a_customer_may_allow_more_than_the_tolerance_but_not_after_the_deadline(
    qos: dict[str, Any], new_min: float, is_late: bool
) -> None:
    before = make_record(eta_min=60, promised_min=60, **qos)
    after = make_record(eta_min=new_min, promised_min=60, **qos)

    assert bool(judge([(before, after)], tolerance_s=60).late) == is_late


@pytest.mark.parametrize(
    ("late_share", "new_min", "is_late"),
    [(None, 90, False), (None, 90.1, True), (0.1, 84, False), (0.1, 84.1, True)],
)
def test_a_delivery_may_come_within_its_window_less_what_the_wind_may_need(
    late_share: float | None, new_min: float, is_late: bool
) -> None:
    before, after = (
        make_record(eta_min=each, promised_min=60, window_min=(60, 90), late_share=late_share)
        for each in (60, new_min)
    )

    assert bool(judge([(before, after)], tolerance_s=60).late) == is_late


@pytest.mark.parametrize(
    ("qos", "new_min", "is_late"),
    [
        ({}, 600, False),
        ({"deadline_at": _NOON + timedelta(minutes=90)}, 90, False),
        ({"deadline_at": _NOON + timedelta(minutes=90)}, 90.1, True),
    ],
)
def test_only_a_deadline_limits_a_delivery_whose_promise_is_provisional(
    qos: dict[str, Any], new_min: float, is_late: bool
) -> None:
    before, after = (
        make_record(eta_min=each, promised_min=60, firm_at=_NOON, **qos) for each in (60, new_min)
    )

    assert bool(judge([(before, after)], tolerance_s=0).late) == is_late


def test_on_a_shared_mission_no_customer_allows_lateness_for_the_others() -> None:
    price = Price(amount=100, currency="USD")
    share = Share(
        mission_id=MissionId("msn_1"),
        delivery_id=DeliveryId("dlv_1"),
        attempt=1,
        price=price,
        pooled_price=price,
        packages={PackageId("p1"): PackageId("p1")},
    )
    before, after = (
        replace(
            make_record(eta_min=eta_min, promised_min=60, may_be_later_s=600),
            shares=(share,),
        )
        for eta_min in (60, 65)
    )

    assert judge([(before, after)], tolerance_s=60).late == {"drn_1"}


def test_each_delivery_of_a_shared_mission_counts_until_its_own_last_package() -> None:
    price = Price(amount=100, currency="USD")
    shares = tuple(
        Share(
            mission_id=MissionId(f"msn_{number}"),
            delivery_id=DeliveryId(f"dlv_{number}"),
            attempt=1,
            price=price,
            pooled_price=price,
            packages={PackageId(f"p{number}"): PackageId(f"p{number}")},
        )
        for number in (1, 2)
    )

    def shared(guest_min: float) -> MissionRecord:
        record = make_record(eta_min=60, promised_min=60)
        guest_at = _NOON + timedelta(minutes=guest_min)
        guest = PackageEta(package_id=PackageId("p2"), eta_at=guest_at)
        packages = (*record.mission.packages, guest)
        mission = record.mission.model_copy(update={"packages": packages})
        return replace(record, mission=mission, shares=shares)

    judgement = judge([(shared(50), shared(40))], tolerance_s=60)

    assert judgement.saved_s == 600


def test_no_saving_is_worth_a_promise_that_is_broken() -> None:
    kept = make_record(eta_min=600, promised_min=600)
    sooner = make_record(eta_min=60, promised_min=600)
    late_before = make_record(eta_min=60, promised_min=60)
    late_after = make_record(eta_min=62, promised_min=60, drone="drn_2")

    judgement = judge([(kept, sooner), (late_before, late_after)], tolerance_s=60)

    assert judgement.saved_s > 10_000
    assert judgement.late == {"drn_2"}
    assert not judgement.is_better
