"""Alarms that state a condition end with it; of all others a person says when they are over."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from skyway_composition import alarm_store
from skyway_composition.gauges import ALARM_CODES
from skyway_composition.missions.mission.end import put_in_doubt
from skyway_composition.missions.mission.record import MissionRecord, Trouble
from skyway_composition.missions.mission.unit_of_work import MissionUnitOfWork, raise_alarm

from skyway.contracts.drone_report import Fault
from skyway.contracts.drones import DRONE_ALARMS, DroneAlarm
from skyway.ids import DroneId, MissionId, ProviderId

pytestmark = pytest.mark.databases("sqlite")

DRONE: Final = DroneId("drn_1")
PAGE: Final = Path(__file__).parents[2] / "docs/reference/operations.md"


def codes_of_page(heading: str) -> set[str]:
    """The codes in the first column of a table of the page."""
    _, _, after = PAGE.read_text().partition(heading)
    table = after.lstrip().split("\n\n")[0].splitlines()
    return {code for line in table[2:] for code in line.split("|")[1].split() if code.isupper()}


async def change(composition: Any, step: Callable[[MissionUnitOfWork, MissionRecord], Any]) -> None:
    """Do something with the drone's live mission in a transaction of its own."""
    async with composition.db.write() as tx:
        work = await MissionUnitOfWork.lock(composition.parts, tx, [DRONE])
        await step(work, work.missions[DRONE])


async def open_codes(composition: Any) -> list[str]:
    answer = await composition("operator:op", "GET", "/v1/alarms?state=OPEN")
    return [each["code"] for each in answer.json()["items"]]


async def begin(work: MissionUnitOfWork, record: MissionRecord, *, code: str) -> None:
    """Put the mission in the state that keeps the alarm open, and raise the alarm."""
    if code in alarm_store.OF_DOUBT:
        await put_in_doubt(work, record, code="SILENT", detail="silent")
        return
    await work.save(record.with_trouble(Trouble(code="PLAN_WANTED", detail="more wind")))
    await raise_alarm(work, record, level="URGENT", code=code, detail="it stands")


async def save_without_condition(work: MissionUnitOfWork, record: MissionRecord) -> None:
    mission = record.mission.model_copy(update={"doubt": None})
    await work.save(replace(record, mission=mission, trouble=None))


async def stage_without_condition(work: MissionUnitOfWork, record: MissionRecord) -> None:
    mission = record.mission.model_copy(update={"doubt": None})
    work.stage(replace(record, mission=mission, trouble=None))
    await work.save_staged()


async def end_mission(work: MissionUnitOfWork, record: MissionRecord) -> None:
    mission = record.mission.model_copy(update={"state": "REFUSED"})
    await work.save(replace(record, mission=mission))


async def save_unchanged(work: MissionUnitOfWork, record: MissionRecord) -> None:
    await work.save(record)


def test_each_code_either_ends_by_itself_or_says_why_a_person_ends_it() -> None:
    by_itself = codes_of_page("end by themselves:")
    by_person = codes_of_page("until a person acknowledges them:")

    about_missions = alarm_store.OF_DOUBT | alarm_store.OF_TROUBLE
    ending = about_missions | alarm_store.OF_SYSTEM | alarm_store.OF_REGISTRY
    ending |= alarm_store.OF_BUSINESS
    assert by_itself == ending
    assert by_person == (ALARM_CODES - set(Fault) - ending) | {"REVISIONS_REFUSED"}


@pytest.mark.parametrize("code", sorted(alarm_store.OF_DOUBT | alarm_store.OF_TROUBLE))
@pytest.mark.parametrize("over", [save_without_condition, stage_without_condition, end_mission])
async def test_an_alarm_about_a_mission_ends_when_what_it_says_is_over(
    composition: Any, code: str, over: Any
) -> None:
    await composition.book()
    await change(composition, lambda work, record: begin(work, record, code=code))
    await change(composition, save_unchanged)
    assert await open_codes(composition) == [code]

    await change(composition, over)

    assert await open_codes(composition) == []
    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert alarm["acknowledged_by"] == "service:composition"


async def test_the_end_of_an_alarm_ends_none_about_another_mission_or_drone(
    composition: Any,
) -> None:
    pairs = [(DroneId(drone), MissionId(of)) for drone in ("d1", "d2") for of in ("m1", "m2")]
    mint = composition.parts.mint
    async with composition.db.write() as tx:
        for drone_id, mission_id in pairs:
            await alarm_store.add(
                tx,
                level="URGENT",
                code="X",
                detail="of a test",
                at_ms=1,
                mint=mint,
                drone_id=drone_id,
                mission_id=mission_id,
            )
        await alarm_store.end(tx, {"X"}, about=pairs[0], at_ms=2)
        shown = alarm_store.AlarmFilter(state="OPEN")
        found = await alarm_store.page(tx.connection, shown, before=None, limit=9)

    assert {(each.drone_id, each.mission_id) for each in found} == {*pairs[1:]}


async def test_an_acknowledged_alarm_is_raised_again_when_its_cause_comes_again(
    composition: Any,
) -> None:
    add = partial(
        alarm_store.add, level="URGENT", code="X", detail="of a test", mint=composition.parts.mint
    )
    async with composition.db.write() as tx:
        found = [await alarm_store.is_open(tx.connection, DRONE, code="X")]
        alarm_id = await add(tx, at_ms=1, drone_id=DRONE)
        found.append(await alarm_store.is_open(tx.connection, DRONE, code="X"))
        await alarm_store.acknowledge(tx, alarm_id, by="operator:op", at_ms=2, note=None)
        found.append(await alarm_store.is_open(tx.connection, DRONE, code="X"))

    assert found == [False, True, False]


async def test_an_alarm_that_an_operator_has_acknowledged_stays_the_operators(
    composition: Any,
) -> None:
    await composition.book()
    await change(composition, lambda work, record: begin(work, record, code="MISSION_IN_DOUBT"))
    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    path = f"/v1/alarms/{alarm['alarm_id']}/acknowledgements"
    await composition("operator:op", "POST", path, {"note": "mine"})

    await change(composition, end_mission)

    (alarm,) = (await composition("operator:op", "GET", "/v1/alarms")).json()["items"]
    assert (alarm["acknowledged_by"], alarm["note"]) == ("operator:op", "mine")


@pytest.mark.parametrize(
    ("code", "still_open"), [("MAINTENANCE_DUE", []), ("DRONE_JUMPED", ["DRONE_JUMPED"])]
)
async def test_the_registry_ends_the_alarms_whose_end_it_knows(
    composition: Any, code: str, still_open: list[str]
) -> None:
    alarm = DroneAlarm(
        provider_id=ProviderId("prv_1"),
        drone_id=DRONE,
        level="WARNING",
        code=code,
        detail="it is due",
        at=composition.clock.now(),
    )
    for is_over in (False, True):
        body = json.loads(alarm.model_copy(update={"is_over": is_over}).model_dump_json())
        answer = await composition("service:registry", "POST", DRONE_ALARMS, body)
        assert answer.status_code == 204, answer.text

    assert await open_codes(composition) == still_open
