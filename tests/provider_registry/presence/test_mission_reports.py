"""Mission reports decide who is busy; late and repeated reports change nothing."""

from collections.abc import Callable
from datetime import timedelta
from typing import Any

import pytest
from skyway_provider_registry.presence.follow import Recorder
from skyway_provider_registry.tables import mission_hints, presence
from sqlalchemy import select

from skyway.contracts.topics import CONNECTION, STATE
from skyway.runtime.clock import ManualClock
from skyway.runtime.mqtt.client import Received
from skyway.runtime.sql.database import Database

pytestmark = pytest.mark.databases("sqlite")

Maker = Callable[..., Any]


@pytest.fixture
async def drone(
    api: Any, db: Database, clock: ManualClock, online: Maker, state: Maker
) -> dict[str, Any]:
    """A drone that stands ready."""
    made: dict[str, Any] = await api.drone(await api.provider())
    ids = (made["provider_id"], made["drone_id"])
    batch = [
        Received(CONNECTION, ids, online(7, 1), False),
        Received(STATE, ids, state(7, 1), False),
    ]
    await Recorder(db, clock).record(batch)
    return made


def make_report(drone: dict[str, Any], seq: int, **members: object) -> dict[str, Any]:
    return {
        "report_id": f"rpt_{seq}",
        "delivery_id": "dlv_1",
        "attempt": 1,
        "trip": 1,
        "mission_id": "msn_1",
        "provider_id": drone["provider_id"],
        "drone_id": drone["drone_id"],
        "seq": seq,
        "kind": "ACCEPTED",
        "at": "2026-03-01T12:00:00Z",
        "mission_state": "ACCEPTED",
        **members,
    }


ACTIVE = {"kind": "LOADING", "mission_state": "ACTIVE"}
FREE_FROM = {"at": "2026-03-01T13:00:00Z", "station_id": "a", "soc": 0.5}
ENDED = {"kind": "ENDED", "mission_state": "COMPLETED"}


async def report_to(api: Any, *reports: dict[str, Any]) -> None:
    for report in reports:
        answer = await api(None, "POST", "/internal/mission-reports", report, service="composition")
        assert answer.status_code == 204, answer.text


async def shown(api: Any, drone: dict[str, Any]) -> tuple[str, str | None]:
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"
    body = (await api("operator:op", "GET", path)).json()
    return body["state"], body["mission_id"]


async def test_reports_of_several_missions_come_in_one_request(
    api: Any, drone: dict[str, Any]
) -> None:
    other = {"mission_id": "msn_2", "drone_id": "drn_nobody"}
    reports = [
        {"traceparent": None, "report": make_report(drone, 1, **other)},
        {"traceparent": None, "report": make_report(drone, 1)},
    ]

    answer = await api(
        None, "POST", "/internal/mission-reports/many", {"reports": reports}, service="composition"
    )

    assert answer.status_code == 204, answer.text
    assert await shown(api, drone) == ("RESERVED", "msn_1")


async def test_a_drone_is_busy_from_acceptance_to_the_end(api: Any, drone: dict[str, Any]) -> None:
    seen = []
    for report in (
        make_report(drone, 1),
        make_report(drone, 2, **ACTIVE),
        make_report(drone, 3, **ENDED),
    ):
        await report_to(api, report)
        seen.append(await shown(api, drone))

    assert seen == [("RESERVED", "msn_1"), ("ON_MISSION", "msn_1"), ("AVAILABLE", None)]


async def test_a_drone_that_has_begun_its_accepted_mission_reads_on_mission(
    api: Any, drone: dict[str, Any], db: Database, clock: ManualClock, state: Maker
) -> None:
    await report_to(api, make_report(drone, 1))
    ids = (drone["provider_id"], drone["drone_id"])

    seen = []
    activities = ("IDLE", "FLYING", "LOADING", "WAITING", "RECHARGING", "DELIVERING")
    for seq, activity in enumerate(activities, start=2):
        message = state(7, seq, mission_id="msn_1", activity=activity)
        await Recorder(db, clock).record([Received(STATE, ids, message, False)])
        fleets = (await api("operator:op", "GET", "/v1/stats/fleets")).json()
        seen.append((await shown(api, drone), fleets["by_state"]))

    reserved = (("RESERVED", "msn_1"), {"RESERVED": 1})
    assert seen == [reserved] + [(("ON_MISSION", "msn_1"), {"ON_MISSION": 1})] * 5


async def test_a_drone_that_still_flies_another_mission_is_only_reserved_for_the_next(
    api: Any, drone: dict[str, Any], db: Database, clock: ManualClock, state: Maker
) -> None:
    await report_to(api, make_report(drone, 1, mission_id="msn_2"))
    ids = (drone["provider_id"], drone["drone_id"])
    message = state(7, 2, mission_id="msn_1", activity="DELIVERING")

    await Recorder(db, clock).record([Received(STATE, ids, message, False)])

    assert await shown(api, drone) == ("RESERVED", "msn_2")


async def test_a_refused_mission_leaves_the_drone_free(api: Any, drone: dict[str, Any]) -> None:
    await report_to(api, make_report(drone, 1, kind="REFUSED", mission_state="REFUSED"))

    assert await shown(api, drone) == ("AVAILABLE", None)


async def test_a_late_copy_of_a_report_does_not_revive_a_mission(
    api: Any, drone: dict[str, Any]
) -> None:
    await report_to(api, make_report(drone, 3, **ENDED), make_report(drone, 1))
    await report_to(api, make_report(drone, 3, **ENDED), make_report(drone, 2, **ACTIVE))

    assert await shown(api, drone) == ("AVAILABLE", None)


async def test_an_ended_mission_does_not_free_a_drone_with_another_mission(
    api: Any, drone: dict[str, Any]
) -> None:
    await report_to(api, make_report(drone, 1, mission_id="msn_2"), make_report(drone, 3, **ENDED))

    assert await shown(api, drone) == ("RESERVED", "msn_2")


async def test_a_report_under_another_provider_is_ignored(api: Any, drone: dict[str, Any]) -> None:
    await report_to(
        api,
        make_report(drone, 1, provider_id="prv_other"),
        make_report(drone, 1, drone_id="drn_unknown"),
    )

    assert await shown(api, drone) == ("AVAILABLE", None)


async def test_fields_of_a_newer_composition_are_ignored(api: Any, drone: dict[str, Any]) -> None:
    await report_to(api, make_report(drone, 1, wind_mps=3.0))

    assert await shown(api, drone) == ("RESERVED", "msn_1")


async def test_an_ended_mission_that_the_drone_still_names_does_not_count(
    api: Any, drone: dict[str, Any], db: Database, clock: ManualClock, state: Maker
) -> None:
    ids = (drone["provider_id"], drone["drone_id"])
    busy = Received(STATE, ids, state(7, 2, mission_id="msn_1", activity="FLYING"), False)
    await Recorder(db, clock).record([busy])
    before = await shown(api, drone)

    await report_to(api, make_report(drone, 3, kind="ENDED", mission_state="ABORTED"))

    assert (before, await shown(api, drone)) == (("ON_MISSION", "msn_1"), ("AVAILABLE", None))


async def test_a_drone_on_a_mission_cannot_be_removed(api: Any, drone: dict[str, Any]) -> None:
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"
    await report_to(api, make_report(drone, 1))

    during = await api("operator:op", "DELETE", path)
    await report_to(api, make_report(drone, 2, **ENDED))
    after = await api("operator:op", "DELETE", path)

    assert (during.status_code, during.json()["code"]) == (409, "ON_MISSION")
    assert "msn_1" in during.json()["detail"]
    assert after.status_code == 204


@pytest.mark.databases("sqlite", "postgresql")
async def test_ended_missions_are_forgotten_after_a_day(
    api: Any, drone: dict[str, Any], db: Database, clock: ManualClock
) -> None:
    await report_to(api, make_report(drone, 1, **ENDED))
    clock.advance(timedelta(hours=25))

    await report_to(api, make_report(drone, 1, mission_id="msn_2", **ENDED))

    async with db.read() as connection:
        left = (await connection.execute(select(mission_hints.c.mission_id))).scalars().all()
    assert left == ["msn_2"]


async def test_only_services_may_report(api: Any, drone: dict[str, Any]) -> None:
    answer = await api(
        "provider:prv_000001", "POST", "/internal/mission-reports", make_report(drone, 1)
    )

    assert answer.status_code == 403


def free_from(at: str, station_id: str = "seguin") -> dict[str, object]:
    return {"at": at, "station_id": station_id, "soc": 0.5}


async def test_a_drone_shows_when_it_is_free_after_all_its_missions(
    api: Any, drone: dict[str, Any]
) -> None:
    first, last = free_from("2026-03-01T15:00:00Z", "kyle"), free_from("2026-03-01T18:00:00Z")
    queued = {"mission_id": "msn_2", "kind": "QUEUED", "mission_state": "QUEUED"}
    path = f"/v1/providers/{drone['provider_id']}/drones/{drone['drone_id']}"
    shown = []
    for report in (
        make_report(drone, 1),
        make_report(drone, 2, **{**ACTIVE, "free_from": first}),
        make_report(drone, 1, **{**queued, "free_from": last}),
        make_report(drone, 3, **ENDED),
    ):
        await report_to(api, report)
        answer = await api(f"provider:{drone['provider_id']}", "GET", path)
        shown.append(answer.json()["free_from"])

    assert shown == [None, first, last, last]


async def test_the_next_busy_drone_that_is_free_is_shown(api: Any) -> None:
    mine, other = await api.provider(), await api.provider()
    # The clock shows 12:00: the first of these moments has passed.
    for provider_id, hour in ((mine, 11), (mine, 16), (mine, 15), (other, 14)):
        made = await api.drone(provider_id)
        free = free_from(f"2026-03-01T{hour}:00:00Z")
        members = {"mission_id": f"msn_{hour}", "free_from": free}
        await report_to(api, make_report(made, 1, **members))

    found = [
        (await api(caller, "GET", "/v1/stats/fleets")).json()["next_free_at"]
        for caller in ("operator:op", f"provider:{mine}")
    ]

    assert found == ["2026-03-01T14:00:00Z", "2026-03-01T15:00:00Z"]


async def test_no_moment_is_shown_when_no_drone_is_busy(api: Any, drone: dict[str, Any]) -> None:
    found = (await api("operator:op", "GET", "/v1/stats/fleets")).json()

    assert (found["drones"], found["next_free_at"]) == (1, None)


@pytest.mark.parametrize("free", [FREE_FROM, None])
@pytest.mark.parametrize("kind", ["RETIMED", "REPLANNED"])
async def test_a_waiting_mission_that_moves_is_a_mission_of_its_new_drone(
    api: Any, db: Database, drone: dict[str, Any], kind: str, free: dict[str, object] | None
) -> None:
    other = await api.drone(drone["provider_id"])
    waits = {"kind": "QUEUED", "mission_state": "QUEUED", "free_from": FREE_FROM}
    await report_to(api, make_report(drone, 1, **waits))

    moved = {"drone_id": other["drone_id"], "drone_before": drone["drone_id"], "free_from": free}
    await report_to(api, make_report(drone, 2, **{**waits, "kind": kind, **moved}))

    async with db.read() as connection:
        rows = (await connection.execute(select(mission_hints.c.drone_id))).all()
        changed = dict(
            (await connection.execute(select(presence.c.drone_id, presence.c.changed))).all()
        )
    assert [row.drone_id for row in rows] == [other["drone_id"]]
    assert changed[drone["drone_id"]] == max(changed.values())
