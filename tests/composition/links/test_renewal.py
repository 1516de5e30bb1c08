"""What a thief sent with a drone's earlier credentials does not bind the drone."""

from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from skyway_composition.links.link import DroneLink
from skyway_composition.links.store import link_to

from skyway.contracts.drones import RENEWALS
from skyway.ids import DroneId

REGISTRY = {"Authorization": "Bearer secret of registry"}

MOST = 2**53 - 1


async def link(composition: Any) -> DroneLink:
    async with composition.db.read() as connection:
        found = await link_to(connection, DroneId("drn_1"))
    assert found is not None
    return found


async def renew(composition: Any) -> None:
    at = composition.clock.now().isoformat()
    body = {"renewals": [{"drone_id": "drn_1", "at": at}, {"drone_id": "drn_unknown", "at": at}]}
    answer = await composition(None, "POST", RENEWALS, body, **REGISTRY)
    assert answer.status_code == 204, answer.text
    composition.clock.advance(timedelta(minutes=1))


@pytest.fixture
def thief(drone: Any) -> Any:
    """Sends with the drone's credentials, in the largest session."""
    return replace(drone, session=MOST)


async def test_the_numbers_of_a_thief_do_not_hide_the_states_of_the_drone(
    composition: Any, drone: Any, thief: Any
) -> None:
    await composition.receive(drone.state(), drone.connection("ONLINE", 1))
    await composition.receive(thief.state(seq=MOST, station_id="e"), thief.connection("LOST", MOST))
    await composition.receive(drone.state(station_id="b"))
    stolen = (await link(composition)).state
    assert stolen is not None
    assert stolen.station_id == "e"

    await renew(composition)
    await composition.receive(drone.state(station_id="b"), drone.connection("ONLINE", 2))

    renewed = await link(composition)
    assert renewed.state is not None
    assert (renewed.state.session, renewed.state.station_id) == (1, "b")
    assert not renewed.is_gone


@pytest.mark.parametrize("stolen", [{"stream": 900}, {"last_event_seq": MOST}])
async def test_a_drone_flies_missions_after_its_credentials_were_stolen(
    composition: Any, drone: Any, thief: Any, stolen: dict[str, int]
) -> None:
    drone.stream = 0
    await composition.receive(drone.state())
    await composition.receive(thief.state(**{"stream": 0, "seq": MOST} | stolen))
    await renew(composition)
    await composition.receive(drone.state())

    await composition.book()
    sent = await composition.sent()
    instruction = next(each for each in sent if each.kind == "MISSION")
    drone.stream = instruction.stream
    await composition.receive(
        drone.ack(instruction), drone.state(mission_id=instruction.mission_id)
    )

    assert await composition.state_of(instruction.mission_id) == "ACCEPTED"


async def test_the_events_of_a_drone_count_after_a_thief_has_numbered_events(
    composition: Any, drone: Any, thief: Any
) -> None:
    drone.stream = thief.stream = 0
    await composition.receive(drone.state())
    for _ in range(5):
        alarm = thief.event("ALARM", code="GPS_LOST", level="WARNING")
        await composition.receive(alarm)
    assert (await link(composition)).last_event_seq == 5

    await renew(composition)
    await composition.receive(drone.state(last_event_seq=0))
    await composition.receive(drone.event("ALARM", code="MOTOR_FAILURE", level="WARNING"))

    assert (await link(composition)).last_event_seq == 1
    alarms = await composition.rows("SELECT code FROM alarms ORDER BY alarm_id")
    assert [row.code for row in alarms] == ["GPS_LOST"] * 5 + ["MOTOR_FAILURE"]


async def test_a_stream_that_nobody_can_have_opened_is_set_aside(
    composition: Any, drone: Any, thief: Any
) -> None:
    await composition.receive(drone.state())

    await composition.receive(thief.state(stream=MOST))
    await composition.parts.quarantine.step()

    assert (await link(composition)).stream <= 2
    (row,) = await composition.rows("SELECT reason FROM quarantine")
    assert row.reason == "IMPLAUSIBLE"


async def test_a_drone_that_opens_stream_after_stream_is_put_out(
    composition: Any, drone: Any
) -> None:
    for _ in range(25):
        await composition.receive(drone.state(stream=(await streams(composition)) + 1))

    assert composition.parts.quarantine.is_shut_out(("prv_1", "drn_1"))


async def streams(composition: Any) -> int:
    rows = await composition.rows("SELECT stream FROM drone_links")
    return int(rows[0].stream) if rows else 0


async def test_what_the_broker_kept_from_before_a_renewal_does_not_count(
    composition: Any, drone: Any, thief: Any
) -> None:
    await composition.receive(drone.state(station_id="b"))
    composition.clock.advance(timedelta(seconds=20))
    stolen = thief.state(station_id="e")
    composition.clock.advance(timedelta(seconds=-20))
    await renew(composition)

    await composition.receive(replace(stolen, retained=True))
    await composition.receive(drone.state(station_id="c"))

    state = (await link(composition)).state
    assert state is not None
    assert state.station_id == "c"


async def test_a_renewal_ends_that_a_drone_is_put_out(composition: Any, drone: Any) -> None:
    quarantine = composition.parts.quarantine
    await composition.receive(drone.state())
    for _ in range(30):
        quarantine.suspect(("prv_1", "drn_1"))
    composition.clock.advance(timedelta(seconds=1))
    await quarantine.step()
    assert quarantine.is_shut_out(("prv_1", "drn_1"))

    await renew(composition)
    await quarantine.step()

    assert not quarantine.is_shut_out(("prv_1", "drn_1"))


async def test_a_rotation_in_flight_changes_nothing(
    composition: Any, drone: Any, make: Any
) -> None:
    await composition.book()
    (instruction,) = await composition.sent()
    flying = {"mission_id": instruction.mission_id, "mission_revision": 1, "activity": "FLYING"}
    await composition.receive(drone.ack(instruction), drone.state(**flying, step_id=2))
    before = await link(composition)

    await renew(composition)
    assert (await link(composition)).is_occupied
    await composition.receive(drone.state(**flying, step_id=2))

    after = await link(composition)
    assert (after.stream, after.last_seq) == (before.stream, before.last_seq)
    assert after.last_event_seq == before.last_event_seq
    assert await composition.state_of(instruction.mission_id) == "ACTIVE"
    assert await composition.rows("SELECT code FROM alarms") == []
    assert await composition.broken() == []


async def test_only_the_registry_renews_credentials(composition: Any) -> None:
    answer = await composition(None, "POST", RENEWALS, {"renewals": []})

    assert answer.status_code == 403
