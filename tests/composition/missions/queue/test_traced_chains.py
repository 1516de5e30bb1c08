"""Missions that wait behind others are each in the trace of their own delivery, also when sent."""

import pytest
from skyway_composition.tables import missions, outbox
from sqlalchemy import select

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.mission_reports import MissionReport
from skyway.runtime.tracing import trace_id_of, tracing
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import CHAIN, book

#: The trace id of the request of each delivery.
TRACES = {delivery_id: f"{number:032x}" for number, delivery_id in enumerate(CHAIN, start=1)}


@pytest.mark.databases("sqlite")
async def test_each_delivery_of_a_chain_has_one_trace_to_its_end(world: BusyWorld) -> None:
    for delivery_id, places in CHAIN.items():
        with tracing(f"00-{TRACES[delivery_id]}-00f067aa0ba902b7-01"):
            assert await book(world, delivery_id, *places) == "BOOKED"
    with tracing(None):
        await world.end()

    async with world.db.read() as connection:
        flown = (await connection.execute(select(missions))).all()
        sent = (await connection.execute(select(outbox))).all()
    reported = {
        (report.delivery_id, trace_id_of(row.traceparent))
        for row in sent
        if row.channel == "gateway"
        for report in [MissionReport.model_validate_json(row.payload)]
    }
    assert reported == set(TRACES.items())
    own = {row.mission_id: TRACES[row.delivery_id] for row in flown}
    said = [
        (own[each.message.mission_id], trace_id_of(each.message.traceparent))
        for each in world.handled
        if isinstance(each.message, DroneEvent) and each.message.mission_id is not None
    ]
    assert said
    assert [trace for trace, _ in said] == [trace for _, trace in said]
