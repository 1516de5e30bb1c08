"""The dry run of a command says what the command would do, and changes nothing."""

from datetime import datetime, timedelta
from typing import Any

import pytest
from skyway_composition.missions.replanning import foresee

from tests.composition.dry_runs import all_rows

pytestmark = pytest.mark.databases("sqlite")

OPERATOR = "operator:op"


async def order(
    composition: Any, mission_id: str, command: str, *, dry_run: bool, **members: Any
) -> Any:
    path = f"/v1/missions/{mission_id}/commands"
    body = {"command": command, "reason": "a crowd below", **members}
    return await composition(OPERATOR, "POST", f"{path}?dry_run=true" if dry_run else path, body)


async def tried(composition: Any, mission_id: str, command: str, **members: Any) -> Any:
    """The answer to a dry run, which has changed nothing."""
    before = await all_rows(composition.db)
    answer = await order(composition, mission_id, command, dry_run=True, **members)
    assert await all_rows(composition.db) == before
    return answer


async def shown(composition: Any, mission_id: str) -> Any:
    return (await composition(OPERATOR, "GET", f"/v1/missions/{mission_id}")).json()


def later_s(package: Any) -> float:
    eta, new_eta = (datetime.fromisoformat(package[each]) for each in ("eta_at", "new_eta_at"))
    return (new_eta - eta).total_seconds()


async def test_a_held_drone_keeps_its_packages_until_it_is_resumed(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)

    answer = await tried(composition, instruction.mission_id, "HOLD")

    assert answer.status_code == 200, answer.text
    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["ends_mission"]) == ("NOT_NEEDED", False)
    assert outlook["next_landing"] is None
    (package,) = outlook["packages"]
    assert (package["fate"], package["station_id"]) == ("WAITS", "a")
    assert (package["new_eta_at"], package["later_by_s"]) == (None, None)


async def test_a_resumed_drone_comes_as_much_later_as_it_has_waited(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await order(composition, instruction.mission_id, "HOLD", dry_run=False)
    composition.clock.advance(timedelta(seconds=1_000))

    answer = await tried(composition, instruction.mission_id, "RESUME")

    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["code"]) == ("NEW_PLAN", None)
    assert outlook["next_landing"]["station_id"] == "b"
    (package,) = outlook["packages"]
    assert (package["fate"], package["station_id"]) == ("DELIVERED", "c")
    assert package["later_by_s"] == later_s(package)
    assert 1_000 <= package["later_by_s"] < 1_060


async def test_the_plan_of_a_dry_run_is_the_plan_that_the_command_gets(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await order(composition, instruction.mission_id, "HOLD", dry_run=False)
    composition.clock.advance(timedelta(seconds=1_000))
    (foreseen,) = (await tried(composition, instruction.mission_id, "RESUME")).json()["outlook"][
        "packages"
    ]

    await order(composition, instruction.mission_id, "RESUME", dry_run=False)
    await composition.replanner.step()

    revision = (await composition.sent())[-1]
    await composition.receive(drone.ack(revision))
    (planned,) = (await shown(composition, instruction.mission_id))["mission"]["packages"]
    assert planned["eta_at"] == foreseen["new_eta_at"]


async def test_a_diverted_drone_waits_with_its_packages_where_it_lands(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)

    answer = await tried(composition, instruction.mission_id, "DIVERT", station_id="b")

    outlook = answer.json()["outlook"]
    assert outlook["plan"] == "NEW_PLAN"
    assert outlook["next_landing"]["station_id"] == "b"
    (package,) = outlook["packages"]
    assert (package["fate"], package["station_id"]) == ("WAITS", "b")


@pytest.mark.parametrize("command", ["RETURN_HOME", "CANCEL"])
async def test_packages_on_board_come_back(
    composition: Any, drone: Any, make: Any, begin: Any, command: str
) -> None:
    instruction = await begin.loaded(composition, drone, make, "b", "c")

    answer = await tried(composition, instruction.mission_id, command)

    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["ends_mission"]) == ("NEW_PLAN", False)
    for package in outlook["packages"]:
        assert (package["fate"], package["station_id"]) == ("RETURNED", "a")
        assert package["new_eta_at"] is None
        assert package["returns_at"] is not None


async def test_a_mission_that_is_cancelled_before_its_pickup_ends(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.at_pickup(composition, drone, make)

    answer = await tried(composition, instruction.mission_id, "CANCEL")

    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["ends_mission"]) == ("NOT_NEEDED", True)
    (package,) = outlook["packages"]
    assert (package["fate"], package["station_id"]) == ("NOT_PICKED_UP", "a")


async def test_a_mission_that_its_drone_must_agree_to_cancel_ends_too(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)

    answer = await tried(composition, instruction.mission_id, "CANCEL")

    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["ends_mission"]) == ("NOT_NEEDED", True)
    assert outlook["detail"] == "the mission ends when its drone has agreed"
    assert outlook["packages"][0]["fate"] == "NOT_PICKED_UP"


async def in_flight(composition: Any, drone: Any, make: Any, begin: Any) -> Any:
    """A mission whose drone flies from a to b."""
    instruction = await begin.loaded(composition, drone, make)
    composition.clock.advance(timedelta(seconds=60))
    state = begin.standing(
        drone,
        instruction,
        activity="FLYING",
        step_id=2,
        released_through=2,
        station_id=None,
        package_ids=["p1"],
    )
    await composition.receive(state)
    return instruction


@pytest.mark.parametrize(
    ("command", "fate"),
    [("HOLD", "WAITS"), ("RETURN_HOME", "RETURNED"), ("CANCEL", "RETURNED")],
)
async def test_a_drone_in_flight_lands_where_it_flies_to(
    composition: Any, drone: Any, make: Any, begin: Any, command: str, fate: str
) -> None:
    instruction = await in_flight(composition, drone, make, begin)

    outlook = (await tried(composition, instruction.mission_id, command)).json()["outlook"]

    assert outlook["next_landing"]["station_id"] == "b"
    assert outlook["next_landing"]["at"] > outlook["reported_at"]
    assert outlook["packages"][0]["fate"] == fate


async def test_a_mission_in_doubt_that_is_given_up_leaves_its_packages(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    composition.clock.advance(timedelta(days=1))
    await composition.overdue.step()

    outlook = (await tried(composition, instruction.mission_id, "GIVE_UP")).json()["outlook"]

    assert (outlook["plan"], outlook["ends_mission"]) == ("NOT_NEEDED", True)
    assert outlook["packages"][0]["fate"] == "NOT_PICKED_UP"


async def test_a_drone_that_has_not_answered_its_plan_gets_no_other_one_yet(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await order(composition, instruction.mission_id, "RETURN_HOME", dry_run=False)
    await composition.replanner.step()

    outlook = (await tried(composition, instruction.mission_id, "CANCEL")).json()["outlook"]

    assert (outlook["plan"], outlook["code"]) == ("NO_PLAN_YET", "NOT_ANSWERED")
    assert outlook["packages"][0]["fate"] == "UNKNOWN"


async def test_a_search_that_takes_too_long_is_said(
    composition: Any, drone: Any, make: Any, begin: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foresee, "LONGEST_S", 0.0)
    instruction = await begin.loaded(composition, drone, make)

    outlook = (await tried(composition, instruction.mission_id, "RETURN_HOME")).json()["outlook"]

    assert (outlook["plan"], outlook["code"]) == ("TIME_UP", None)
    assert outlook["packages"][0]["fate"] == "UNKNOWN"


async def test_a_station_out_of_reach_is_named_as_the_reason(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    for to_id in "ac":
        path = f"/v1/segments/{to_id}/b/closures"
        assert (await composition(OPERATOR, "POST", path, {})).status_code == 201

    answer = await tried(composition, instruction.mission_id, "DIVERT", station_id="b")

    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["code"]) == ("NO_PLAN", "DESTINATION_UNREACHABLE")
    assert outlook["packages"][0]["fate"] == "WAITS"


async def test_a_ground_stop_delays_the_plan(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.loaded(composition, drone, make)
    await order(composition, instruction.mission_id, "HOLD", dry_run=False)
    await composition(OPERATOR, "POST", "/v1/ground-stops", {"reason": "fog"})

    answer = await tried(composition, instruction.mission_id, "RESUME")

    outlook = answer.json()["outlook"]
    assert (outlook["plan"], outlook["code"]) == ("NO_PLAN_YET", "GROUND_STOP")
    assert outlook["detail"].endswith("fog")
    assert outlook["packages"][0]["fate"] == "WAITS"


@pytest.mark.parametrize(
    ("stage", "command", "members"),
    [
        ("accepted", "RESUME", {}),
        ("accepted", "RETURN_HOME", {}),
        ("accepted", "GIVE_UP", {}),
        ("accepted", "DIVERT", {"station_id": "nowhere"}),
        ("accepted", "DIVERT", {}),
    ],
)
async def test_a_dry_run_is_refused_as_the_command_would_be(
    composition: Any,
    drone: Any,
    make: Any,
    begin: Any,
    stage: str,
    command: str,
    members: dict[str, str],
) -> None:
    instruction = await getattr(begin, stage)(composition, drone, make)
    mission_id = instruction.mission_id

    refused = await tried(composition, mission_id, command, **members)

    answer = await order(composition, mission_id, command, dry_run=False, **members)
    assert refused.status_code == answer.status_code
    same = ("type", "status", "code", "detail", "errors")
    assert [refused.json().get(each) for each in same] == [answer.json().get(each) for each in same]


async def test_only_operators_preview_commands(
    composition: Any, drone: Any, make: Any, begin: Any
) -> None:
    instruction = await begin.accepted(composition, drone, make)
    path = f"/v1/missions/{instruction.mission_id}/commands?dry_run=true"

    answer = await composition("provider:prv_1", "POST", path, {"command": "HOLD", "reason": "x"})

    assert answer.status_code == 403
