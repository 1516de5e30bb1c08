"""Missions over REST: providers and drones see their own, operators see all."""

import json
from typing import Any

import pytest

from skyway.drone.models import DRONE_MODELS
from skyway.ids import DroneModelId

KEEPS_A_FIFTH = DRONE_MODELS[DroneModelId("paper-scenario")].model_copy(update={"reserve_soc": 0.2})

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def two_missions(composition: Any, make: Any) -> tuple[str, str]:
    mine = await composition.book(make.candidate(1))
    theirs = await composition.book(make.candidate(2, provider_id="prv_2"), delivery_id="dlv_2")
    return mine.missions[0].mission_id, theirs.missions[0].mission_id


async def test_a_provider_sees_its_own_missions_only(composition: Any, make: Any) -> None:
    mine, theirs = await two_missions(composition, make)

    listed = await composition("provider:prv_1", "GET", "/v1/missions")
    own = await composition("provider:prv_1", "GET", f"/v1/missions/{mine}")
    foreign = await composition("provider:prv_1", "GET", f"/v1/missions/{theirs}")

    assert [item["mission_id"] for item in listed.json()["items"]] == [mine]
    assert (own.status_code, foreign.status_code) == (200, 404)


async def test_a_drone_sees_its_own_missions_only(composition: Any, make: Any) -> None:
    mine, theirs = await two_missions(composition, make)

    listed = await composition("drone:drn_1", "GET", "/v1/missions?drone_id=drn_2")
    own = await composition("drone:drn_1", "GET", f"/v1/missions/{mine}")
    foreign = await composition("drone:drn_1", "GET", f"/v1/missions/{theirs}")

    assert [item["mission_id"] for item in listed.json()["items"]] == [mine]
    assert (own.status_code, foreign.status_code) == (200, 404)


async def test_operators_see_all_missions_and_can_filter_them(composition: Any, make: Any) -> None:
    mine, theirs = await two_missions(composition, make)

    everything = await composition("operator:op", "GET", "/v1/missions")
    narrowed = await composition("operator:op", "GET", "/v1/missions?delivery_id=dlv_2")
    none = await composition("operator:op", "GET", "/v1/missions?state=COMPLETED&drone_id=drn_1")

    assert [item["mission_id"] for item in everything.json()["items"]] == [theirs, mine]
    assert [item["mission_id"] for item in narrowed.json()["items"]] == [theirs]
    assert none.json()["items"] == []


async def listed_mission(composition: Any) -> Any:
    [item] = (await composition("operator:op", "GET", "/v1/missions")).json()["items"]
    return item


async def test_a_listed_mission_shows_its_present_step_and_where_its_drone_is(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    booked = await listed_mission(composition)
    flown = drone.flown(instruction)
    await composition.receive(drone.ack(instruction), *flown[:1])
    await composition.receive(
        drone.state(
            activity="FLYING",
            mission_id=instruction.mission_id,
            step_id=instruction.steps[1].step_id,
            station_id=None,
            position=(0.25, 0.5),
            soc=0.75,
            last_instruction_seq=instruction.seq,
        )
    )
    flying = await listed_mission(composition)
    await composition.receive(*flown[1:])
    over = await listed_mission(composition)

    first, second = (json.loads(each.model_dump_json()) for each in instruction.steps[:2])
    assert (booked["step"], booked["position"], booked["soc"]) == (first, None, None)
    assert (flying["step"], flying["position"], flying["soc"]) == (second, [0.25, 0.5], 0.75)
    assert flying["position_at"] is not None
    assert (over["step"], over["position"], over["position_at"]) == (None, None, None)


async def test_a_drone_on_another_mission_is_not_shown(composition: Any, drone: Any) -> None:
    await composition.book()
    await composition.receive(drone.state(mission_id="mis_other", position=(0.25, 0.5)))

    assert (await listed_mission(composition))["position"] is None


async def test_missions_come_in_pages(composition: Any, make: Any) -> None:
    mine, theirs = await two_missions(composition, make)

    first = await composition("operator:op", "GET", "/v1/missions?limit=1")
    second = await composition(
        "operator:op", "GET", f"/v1/missions?limit=1&cursor={first.json()['next_cursor']}"
    )

    assert [page.json()["items"][0]["mission_id"] for page in (first, second)] == [theirs, mine]
    assert second.json()["next_cursor"] is None


async def test_a_mission_shows_its_steps_and_what_was_flown(composition: Any, drone: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    await composition.receive(drone.ack(instruction), *drone.flown(instruction)[:2])

    answer = await composition("operator:op", "GET", f"/v1/missions/{instruction.mission_id}")

    statuses = [step["status"] for step in answer.json()["steps"]]
    assert statuses[:3] == ["ENDED", "ENDED", "PLANNED"]
    assert answer.json()["flown"]["flight_s"] > 0


async def test_customers_may_not_list_missions(composition: Any) -> None:
    answer = await composition("customer:c", "GET", "/v1/missions")

    assert answer.status_code == 403


async def test_only_services_may_book(composition: Any, make: Any) -> None:
    body = {"attempt": 1, "request": make.request("c").model_dump(mode="json"), "shortlist": {}}

    for path in ("missions", "closed"):
        answer = await composition("operator:op", "PUT", f"/internal/deliveries/dlv_1/{path}", body)
        assert answer.status_code == 403


@pytest.mark.parametrize(
    ("requested", "outcome", "code"),
    [
        ({"qos": {"max_price": 1}}, "INFEASIBLE", "TOO_EXPENSIVE"),
        ({"qos": {"deadline_at": "2026-03-01T12:30:00Z"}}, "INFEASIBLE", "TOO_LATE"),
        ({"mass_kg": 20.0}, "INFEASIBLE", "OVERWEIGHT"),
        ({"pickup": "nowhere"}, "INFEASIBLE", "DESTINATION_UNREACHABLE"),
    ],
)
async def test_an_infeasible_request_gets_the_reasons(
    composition: Any, make: Any, requested: dict[str, Any], outcome: str, code: str
) -> None:
    booking = await composition.book(request=make.request("c", **requested))

    assert booking.outcome == outcome
    assert [reason.code for reason in booking.reasons] == [code]


@pytest.mark.parametrize(
    ("members", "outcome", "code"),
    [
        ({"soc": 0.1, "model": KEEPS_A_FIFTH}, "BUSY", "LOW_CHARGE"),
        ({"tariff": {"currency": "EUR"}}, "INFEASIBLE", "OTHER_CURRENCY"),
        ({"station_id": "nowhere"}, "INFEASIBLE", "DESTINATION_UNREACHABLE"),
    ],
)
async def test_a_drone_that_cannot_fly_the_request_gets_a_reason(
    composition: Any, make: Any, members: dict[str, Any], outcome: str, code: str
) -> None:
    booking = await composition.book(make.candidate(**members))

    assert booking.outcome == outcome
    assert [reason.code for reason in booking.reasons] == [code]


async def test_the_cheapest_offer_is_booked_when_price_counts(composition: Any, make: Any) -> None:
    dear = make.candidate(1, tariff={"base": 900})
    cheap = make.candidate(2, provider_id="prv_2", station_id="b", tariff={"base": 100})

    fastest = await composition.book(dear, cheap)
    cheapest = await composition.book(
        make.candidate(3, tariff={"base": 900}),
        cheap,
        delivery_id="dlv_2",
        request=make.request("c", qos={"objective": "CHEAPEST"}),
    )

    assert fastest.missions[0].drone_id == "drn_1"
    assert cheapest.missions[0].drone_id == "drn_2"


async def test_without_candidates_the_booking_is_busy(composition: Any, make: Any) -> None:
    body = {"attempt": 1, "request": make.request("c").model_dump(mode="json"), "shortlist": {}}

    answer = await composition(
        "service:gateway", "PUT", "/internal/deliveries/dlv_1/missions", body
    )

    assert answer.json()["outcome"] == "BUSY"
