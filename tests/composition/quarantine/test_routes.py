"""Operators look at set-aside messages, replay and delete them."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.missions.following.follow import Follower
from sqlalchemy import text

from skyway.units import moment_to_ms
from tests.composition.missions.following.test_poisoned_messages import OneBatch
from tests.composition.quarantine.test_set_aside import unreadable

pytestmark = pytest.mark.databases("sqlite")

OPERATOR = "operator:op"


async def set_aside(composition: Any, *batch: Any) -> list[Any]:
    """What the list shows after this batch has arrived."""
    follower = Follower(
        composition.handler,
        OneBatch([*batch]),
        doorkeeper=composition.parts.signatures,
        clock=composition.clock,
        quarantine=composition.parts.quarantine,
        listening=composition.listening,
    )
    await follower.step()
    await composition.parts.quarantine.step()
    answer = await composition(OPERATOR, "GET", "/v1/quarantine")
    return list(answer.json()["items"])


@pytest.fixture
async def early_ack(composition: Any, drone: Any) -> Any:
    """The acceptance of a booked mission, from a drone whose clock is two hours ahead."""
    await composition.book()
    (instruction,) = await composition.sent()
    composition.clock.advance(timedelta(hours=2))
    ack = drone.ack(instruction)
    composition.clock.advance(-timedelta(hours=2))
    return ack


async def test_a_message_about_the_future_is_listed(composition: Any, early_ack: Any) -> None:
    (shown,) = await set_aside(composition, early_ack)

    assert shown["reason"] == "AHEAD"
    assert shown["topic"] == "skyway/v1/prv_1/drn_1/acks"
    assert (shown["provider_id"], shown["drone_id"]) == ("prv_1", "drn_1")
    assert (shown["times"], shown["received_at"]) == (1, "2026-03-01T12:00:00Z")


async def test_a_message_is_replayed_when_its_time_has_come(
    composition: Any, early_ack: Any
) -> None:
    (shown,) = await set_aside(composition, early_ack)
    path = f"/v1/quarantine/{shown['quarantine_id']}/replay"
    (before,) = await composition.rows("SELECT state FROM missions")

    too_early = await composition(OPERATOR, "POST", path)
    composition.clock.advance(timedelta(hours=2))
    in_time = await composition(OPERATOR, "POST", path)

    assert (too_early.status_code, too_early.json()["code"]) == (409, "STILL_NOT_TAKEN")
    assert in_time.status_code == 204
    assert (before.state, await composition.rows("SELECT state FROM missions")) == (
        "BOOKED",
        [("ACCEPTED",)],
    )
    assert (await composition(OPERATOR, "GET", "/v1/quarantine")).json()["items"] == []


async def test_a_message_in_anothers_name_is_not_replayed(composition: Any, drone: Any) -> None:
    await composition.receive(drone.state())
    (shown,) = await set_aside(composition, replace(drone, provider_id="prv_2").state())

    path = f"/v1/quarantine/{shown['quarantine_id']}/replay"
    answer = await composition(OPERATOR, "POST", path)

    assert (shown["reason"], shown["provider_id"]) == ("FOREIGN_PROVIDER", "prv_2")
    assert (answer.status_code, answer.json()["code"]) == (409, "STILL_NOT_TAKEN")


async def test_a_message_that_no_drone_says_stays_as_it_is_when_it_is_replayed(
    composition: Any, drone: Any
) -> None:
    await composition.receive(drone.state())
    shown = await set_aside(composition, drone.state(stream=5_000))
    path = f"/v1/quarantine/{shown[0]['quarantine_id']}/replay"

    # Often enough that the drone would be put out if each replay counted.
    answers = [await composition(OPERATOR, "POST", path) for _ in range(30)]
    await composition.parts.quarantine.step()

    assert {(each.status_code, each.json()["code"]) for each in answers} == {
        (409, "STILL_NOT_TAKEN")
    }
    assert (await composition(OPERATOR, "GET", "/v1/quarantine")).json()["items"] == shown
    assert shown[0]["reason"] == "IMPLAUSIBLE"
    assert not composition.parts.quarantine.is_shut_out(("prv_1", "drn_1"))


@pytest.mark.databases("sqlite", "postgresql")
async def test_a_message_of_earlier_credentials_is_not_replayed(
    composition: Any, early_ack: Any
) -> None:
    (shown,) = await set_aside(composition, early_ack)
    renewed_ms = moment_to_ms(composition.clock.now())
    async with composition.db.write() as tx:
        await tx.execute(text(f"UPDATE drone_links SET renewed_ms = {renewed_ms}"))
    composition.clock.advance(timedelta(hours=2))

    path = f"/v1/quarantine/{shown['quarantine_id']}/replay"
    answer = await composition(OPERATOR, "POST", path)

    assert (answer.status_code, "other credentials" in answer.json()["detail"]) == (409, True)
    assert await composition.rows("SELECT state FROM missions") == [("BOOKED",)]


async def test_a_message_that_was_cut_is_not_replayed(composition: Any) -> None:
    quarantine_id = await keep(composition, b'{"' + b"x" * 10_000)

    answer = await composition(OPERATOR, "POST", f"/v1/quarantine/{quarantine_id}/replay")

    assert (answer.status_code, answer.json()["code"]) == (409, "PAYLOAD_CUT")


async def test_an_unreadable_message_is_shown_without_what_a_terminal_obeys(
    composition: Any,
) -> None:
    quarantine_id = await keep(composition, b"\xff\x1b[2J\x00ok")

    (shown,) = (await composition(OPERATOR, "GET", "/v1/quarantine")).json()["items"]
    replayed = await composition(OPERATOR, "POST", f"/v1/quarantine/{quarantine_id}/replay")

    assert shown["payload"] == "\\xff\\x1b[2J\\x00ok"
    assert replayed.status_code == 409


async def test_a_message_is_deleted_once(composition: Any) -> None:
    path = f"/v1/quarantine/{await keep(composition, b'{')}"

    answers = [await composition(OPERATOR, "DELETE", path) for _ in range(2)]

    assert [answer.status_code for answer in answers] == [204, 404]
    missing = await composition(OPERATOR, "POST", f"{path}/replay")
    assert missing.status_code == 404


@pytest.mark.databases("sqlite", "postgresql")
async def test_the_list_has_pages_and_a_filter(composition: Any) -> None:
    first, second = [await keep(composition, b"{" * number) for number in (1, 2)]

    page = (await composition(OPERATOR, "GET", "/v1/quarantine?limit=1")).json()
    rest = await composition(
        OPERATOR, "GET", f"/v1/quarantine?limit=1&cursor={page['next_cursor']}"
    )
    other = await composition(OPERATOR, "GET", "/v1/quarantine?provider_id=prv_2")

    assert [each["quarantine_id"] for each in page["items"]] == [second]
    assert [each["quarantine_id"] for each in rest.json()["items"]] == [first]
    assert other.json()["items"] == []


@pytest.mark.parametrize("caller", ["customer:c", "provider:prv_1", "drone:drn_1"])
async def test_only_operators_see_the_quarantine(composition: Any, caller: str) -> None:
    path = f"/v1/quarantine/{await keep(composition, b'{')}"

    answers = [
        await composition(caller, "GET", "/v1/quarantine"),
        await composition(caller, "DELETE", path),
        await composition(caller, "POST", f"{path}/replay"),
    ]

    assert [answer.status_code for answer in answers] == [403, 403, 403]


async def keep(composition: Any, payload: bytes) -> str:
    """Set aside an unreadable state; the id of its row."""
    quarantine = composition.parts.quarantine
    unreadable(quarantine, payload)
    await quarantine.step()
    answer = await composition(OPERATOR, "GET", "/v1/quarantine")
    return str(answer.json()["items"][0]["quarantine_id"])
