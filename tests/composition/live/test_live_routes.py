"""The gateway reads missions, pads, closures and alarms for its live picture."""

from datetime import datetime
from typing import Any

from tests.composition.conftest import GATEWAY, OPERATOR, make_request
from tests.composition.missions.conftest import accepted, loaded

WORLD, MISSIONS = "/internal/live/world", "/internal/live/missions"


async def world(composition: Any) -> Any:
    answer = await composition(GATEWAY, "GET", WORLD)
    assert answer.status_code == 200, answer.text
    return answer.json()


async def missions(composition: Any, *mission_ids: str) -> Any:
    answer = await composition(GATEWAY, "POST", MISSIONS, {"mission_ids": mission_ids})
    assert answer.status_code == 200, answer.text
    return answer.json()["missions"]


async def test_a_booked_mission_shows_its_steps_and_pads(composition: Any) -> None:
    await composition.book()

    now = await world(composition)
    (version,) = now["missions"]
    (mission,) = await missions(composition, version["mission_id"])

    kinds = [step["kind"] for step in mission["steps"]]
    assert kinds[: mission["service_steps"]][-1] == "DELIVER"
    assert kinds[mission["service_steps"] :], "the way home belongs to the mission"
    assert (mission["state"], mission["is_carrying"]) == ("BOOKED", False)
    assert {station["station_id"] for station in now["stations"]} >= {
        step["station_id"] for step in mission["steps"] if step["kind"] == "RECHARGE"
    }
    assert [each["package_id"] for each in mission["packages"]] == ["p1"]


async def test_each_step_of_a_mission_changes_its_version(composition: Any, drone: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    versions = [(await world(composition))["missions"]]
    pick_up, fly, *_ = drone.flown(instruction)

    for message in (drone.ack(instruction), pick_up, fly):
        await composition.receive(message)
        versions.append((await world(composition))["missions"])

    assert len({each[0]["version"] for each in versions}) == len(versions)
    (mission,) = await missions(composition, versions[0][0]["mission_id"])
    assert mission["is_carrying"]
    assert [step["status"] for step in mission["steps"]][:3] == ["ENDED", "ENDED", "PLANNED"]


async def version_of(composition: Any) -> str:
    (mission,) = (await world(composition))["missions"]
    return str(mission["version"])


async def test_a_hold_its_refusal_and_its_end_change_the_version(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction = await accepted(composition, drone, make)
    path = f"/v1/missions/{instruction.mission_id}/commands"
    versions = [await version_of(composition)]

    await composition(OPERATOR, "POST", path, {"command": "HOLD", "reason": "a crowd below"})
    versions.append(await version_of(composition))
    (shown,) = await missions(composition, instruction.mission_id)
    assert shown["is_held"]
    hold = (await composition.sent())[-1]
    await composition.receive(drone.ack(hold, "REJECTED", code="EXPIRED"))
    versions.append(await version_of(composition))
    await composition(OPERATOR, "POST", path, {"command": "HOLD", "reason": "a crowd below"})
    await composition(OPERATOR, "POST", path, {"command": "RESUME", "reason": "it has left"})
    versions.append(await version_of(composition))

    before, while_held, after_refusal, resumed = versions
    assert while_held not in (before, after_refusal)
    assert resumed not in (before, while_held, after_refusal)


async def test_a_trouble_that_replaces_another_changes_the_version(
    composition: Any, drone: Any, make: Any
) -> None:
    instruction = await loaded(composition, drone, make)
    alarm = {"mission_id": instruction.mission_id, "code": "PLAN_WANTED", "detail": "head wind"}
    await composition.receive(drone.event("ALARM", **alarm))
    path = f"/v1/missions/{instruction.mission_id}/commands"
    await composition(OPERATOR, "POST", path, {"command": "HOLD", "reason": "a storm"})
    before = await version_of(composition)
    (shown,) = await missions(composition, instruction.mission_id)
    assert (shown["trouble"], shown["is_held"]) == ("PLAN_WANTED", True)

    divert = {"command": "DIVERT", "reason": "a storm", "station_id": "b"}
    answer = await composition(OPERATOR, "POST", path, divert)
    assert answer.status_code == 202, answer.text

    (shown,) = await missions(composition, instruction.mission_id)
    assert (shown["trouble"], shown["is_held"]) == ("DIVERTED", True)
    assert await version_of(composition) != before


async def test_a_mission_that_is_over_is_shown_no_more(composition: Any, drone: Any) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    mission_id = (await world(composition))["missions"][0]["mission_id"]

    await composition.receive(drone.ack(instruction), *drone.flown(instruction))

    assert (await world(composition))["missions"] == []
    assert await missions(composition, mission_id) == []


async def test_closures_are_shown_until_they_are_lifted(composition: Any) -> None:
    made = await composition(
        OPERATOR, "POST", "/v1/stations/b/closures", {"reason": "the roof is being repaired"}
    )
    assert made.status_code == 201, made.text
    outage = await composition(OPERATOR, "POST", "/v1/stations/c/pads/0/outages", {})

    now = await world(composition)
    assert [(each["kind"], each["station_id"]) for each in now["closures"]] == [
        ("STATION", "b"),
        ("PAD", "c"),
    ]
    assert [(each["station_id"], each["pads_taken"]) for each in now["stations"]] == [("c", 1)]

    closure_id, outage_id = made.json()["closure_id"], outage.json()["closure_id"]
    await composition(OPERATOR, "DELETE", f"/v1/stations/b/closures/{closure_id}")
    await composition(OPERATOR, "DELETE", f"/v1/stations/c/pads/0/outages/{outage_id}")
    now = await world(composition)
    assert (now["closures"], now["stations"]) == ([], [])


def moment(text: str) -> datetime:
    return datetime.fromisoformat(text)


async def outage(composition: Any, pad: int, **body: Any) -> None:
    answer = await composition(OPERATOR, "POST", f"/v1/stations/c/pads/{pad}/outages", body)
    assert answer.status_code == 201, answer.text


async def test_a_pad_with_two_outages_is_counted_once(composition: Any) -> None:
    await outage(composition, 0, until="2026-03-01T13:00:00Z")
    await outage(composition, 0)

    (station,) = (await world(composition))["stations"]

    assert (station["pads"], station["pads_taken"]) == (2, 1)
    assert station["taken"] == {"0": {"is_out_of_order": True}}


async def test_a_reserved_pad_that_is_out_of_order_is_counted_once(composition: Any) -> None:
    await composition.book(request=make_request("e"))
    listed = await composition(OPERATOR, "GET", "/v1/stations/c/reservations")
    reservation = listed.json()["items"][0]
    composition.clock.advance(moment(reservation["start_at"]) - composition.clock.now())
    await outage(composition, reservation["pad"], until="2026-03-02T12:00:00Z")

    stations = {each["station_id"]: each for each in (await world(composition))["stations"]}
    pads = (await composition(OPERATOR, "GET", "/v1/stations/c/pads")).json()

    assert stations["c"]["pads_taken"] == pads["pads_taken"] == 1
    assert stations["c"]["taken"] == {
        str(reservation["pad"]): {
            "taken_until_at": reservation["end_at"],
            "is_out_of_order": True,
            "works_again_at": "2026-03-02T12:00:00Z",
        }
    }


async def test_only_the_gateway_may_ask(composition: Any) -> None:
    answer = await composition(OPERATOR, "GET", WORLD)

    assert answer.status_code == 403
