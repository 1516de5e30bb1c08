"""A drone that has forgotten its answers gets its instructions in a new stream."""

from typing import Any

import pytest

pytestmark = pytest.mark.parametrize("migrated_url", ["sqlite"], indirect=True)


async def test_a_drone_with_an_old_copy_of_its_journal_gets_a_new_stream(
    composition: Any, drone: Any, make: Any
) -> None:
    await composition.book()
    (first,) = await composition.sent()
    await composition.receive(drone.ack(first), *drone.flown(first))
    drone.session, drone.event_seq = 2, 0
    await composition.receive(drone.state())
    await composition.book(make.candidate(), delivery_id="dlv_2")
    (second,) = await composition.sent()
    gap = {"code": "SEQUENCE_GAP", "data": {"expected_seq": first.seq, "stream": 1}}

    await composition.receive(drone.ack(second, "REJECTED", **gap))

    (again,) = await composition.sent()
    assert (again.stream, again.seq) == (2, 1)
    assert again.mission_id == second.mission_id
