"""True messages that come again, as a broker in the wrong hands repeats them, change nothing."""

from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def everything(composition: Any) -> dict[str, list[Any]]:
    """What missions, custody, steps, reports and alarms say."""
    tables = ("missions", "mission_steps", "custody", "pad_reservations", "alarms", "instructions")
    found = {each: list(await composition.rows(f"SELECT * FROM {each}")) for each in tables}
    found["reports"] = [each.kind for each in await composition.reports()]
    return found


async def test_all_messages_of_a_mission_come_again_at_every_moment(
    composition: Any, drone: Any
) -> None:
    await composition.receive(drone.connection("ONLINE"), drone.state(stream=0))
    await composition.book()
    (instruction,) = await composition.sent()
    said = [drone.ack(instruction, "RECEIVED"), drone.ack(instruction)]
    await composition.receive(*said)
    for event in drone.flown(instruction):
        said.append(event)
        await composition.receive(event)
        said.append(drone.state())
        await composition.receive(said[-1])
        before = await everything(composition)
        await composition.receive(*said)
        await composition.receive(*reversed(said))
        assert await everything(composition) == before

    assert await composition.state_of(instruction.mission_id) == "COMPLETED"
    assert await composition.broken() == []


async def test_messages_of_the_last_mission_do_not_touch_the_next_one(
    composition: Any, drone: Any
) -> None:
    await composition.book()
    (first,) = await composition.sent()
    said = [drone.ack(first), *drone.flown(first)]
    await composition.receive(*said)
    await composition.receive(drone.state())
    await composition.book(delivery_id="dlv_2")
    (second,) = await composition.sent()
    before = await everything(composition)

    await composition.receive(*said)

    assert await everything(composition) == before
    assert await composition.state_of(second.mission_id) == "BOOKED"


async def test_events_of_a_lost_journal_do_not_use_up_the_numbers_of_the_new_one(
    composition: Any, drone: Any
) -> None:
    await composition.receive(drone.state(stream=0, journal_session=1))
    await composition.book()
    (first,) = await composition.sent()
    drone.stream = first.stream
    old = [drone.ack(first), *drone.flown(first)]
    await composition.receive(*old, drone.state(journal_session=1))
    drone.session, drone.stream, drone.event_seq = 2, 0, 0
    await composition.receive(drone.state(journal_session=2))

    await composition.receive(*old)
    (row,) = await composition.rows("SELECT last_event_seq FROM drone_links")

    assert row.last_event_seq == 0


async def test_a_repeated_loss_of_an_earlier_connection_is_ignored(
    composition: Any, drone: Any
) -> None:
    lost = drone.connection("LOST", 1)
    await composition.receive(drone.connection("ONLINE", 1), drone.connection("ONLINE", 2))

    await composition.receive(lost)
    (row,) = await composition.rows("SELECT connection FROM drone_links")

    assert '"ONLINE"' in row.connection
