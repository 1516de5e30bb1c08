"""Many customers book the same few drones at the same moment."""

import asyncio
from itertools import pairwise

import pytest
from skyway_composition.missions.mission.store import queued_of_delivery

from skyway.ids import DeliveryId
from tests.composition.busy_world import BusyWorld
from tests.composition.missions.queue.booked_chain import request


@pytest.fixture
def package() -> str:
    return "skyway_composition"


@pytest.mark.databases("postgresql")
async def test_twenty_bookings_on_four_drones_give_calendars_without_overlaps(
    migrated_url: str,
) -> None:
    async with BusyWorld(migrated_url) as world:
        ids = [f"dlv{number}" for number in range(1, 21)]

        outcomes = await asyncio.gather(
            *(world.book(each, request(each, "a", "b"), loading="AUTOMATIC") for each in ids)
        )

        await world.check()
        assert set(outcomes) <= {"BOOKED", "BUSY"}
        booked = {each for each, outcome in zip(ids, outcomes, strict=True) if outcome == "BOOKED"}
        assert len(booked) >= len(world.drones)
        planned = await world.planned()
        assert {str(each.mission.delivery_id) for each in planned} == booked
        for before, after in pairwise(planned):
            if before.drone_id == after.drone_id:
                assert before.served_ms <= after.start.at_ms
        async with world.db.read() as connection:
            for each in ids:
                missions = await queued_of_delivery(connection, DeliveryId(each))
                assert len(missions) <= 1
