"""What a plan says about itself."""

from skyway.delivery.plan import Fly, PickUp, Plan, PlanStatus
from skyway.ids import PackageId, StationId

A, B, C = StationId("a"), StationId("b"), StationId("c")


def fly(start: StationId, end: StationId, start_s: float, end_s: float) -> Fly:
    return Fly.model_validate(
        {
            "from": start,
            "to": end,
            "start_s": start_s,
            "end_s": end_s,
            "load_kg": 0.0,
            "energy_j": 1.0,
            "soc_end": 0.9,
        }
    )


def test_a_drone_that_flies_to_the_pickup_begins_to_load_when_it_is_there() -> None:
    load = PickUp(station_id=B, package_ids=(PackageId("p1"),), start_s=300, end_s=360)
    plan = Plan(status=PlanStatus.OPTIMAL, steps=(fly(A, B, 0, 300), load, fly(B, C, 360, 600)))

    assert plan.pickup_s == 300


def test_a_plan_that_loads_nothing_picks_up_at_its_start() -> None:
    assert Plan(status=PlanStatus.OPTIMAL, steps=(fly(A, B, 0, 300),)).pickup_s == 0
