"""A story test: in random orders of actions no invariant of missions and pads breaks."""

import asyncio
from datetime import timedelta
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skyway.delivery.request import DeliveryRequest
from tests.composition.busy_story import ACTIONS, BETWEEN_A_AND_B, Story, chosen_actions
from tests.composition.busy_world import BusyWorld

_SEEDS = st.integers(0, 10_000)
_ACTIONS = st.lists(st.tuples(st.sampled_from(ACTIONS), _SEEDS), min_size=25, max_size=45)
#: A story takes seconds. PostgreSQL gets fewer, because each statement is a round trip.
_STORIES = {"sqlite": 5, "postgresql": 2}


@pytest.mark.long
def test_no_invariant_breaks_in_any_order_of_events(migrated_url: str) -> None:
    dialect, _, _ = migrated_url.partition(":")

    @settings(max_examples=_STORIES[dialect])
    @given(actions=_ACTIONS)
    def play_story(actions: list[tuple[str, int]]) -> None:
        asyncio.run(Story.play(migrated_url, actions))

    play_story()


@pytest.mark.long
@pytest.mark.databases("postgresql")
def test_the_same_actions_lead_to_the_same_reports(migrated_url: str) -> None:
    """On PostgreSQL, where rows have no order of their own."""
    # The order of concurrent bookings depends on threads.
    chosen = [each for each in chosen_actions(Random(5))[:16] if each[0] != "book_together"]

    @given(actions=st.just(chosen))
    def play_twice(actions: list[tuple[str, int]]) -> None:
        once, again = (asyncio.run(Story.play(migrated_url, actions)) for _ in range(2))
        assert once == again

    play_twice()


@pytest.mark.databases("sqlite")
async def test_a_flight_that_began_before_its_drone_knew_of_a_closure_breaks_no_rule(
    migrated_url: str,
) -> None:
    request = DeliveryRequest.model_validate(
        {
            "pickup": {"station_id": "a"},
            "packages": [{"package_id": "p1", "mass_kg": 0.4, "destination": {"station_id": "b"}}],
        }
    )
    async with BusyWorld(migrated_url) as world:
        await world.book(world.new_delivery(), request, loading="AUTOMATIC")
        await world.keep_calendars()
        while not any(each.is_handing_over for each in world.drones):
            await world.pass_time(timedelta(seconds=30))
        # The new plan is lost, and the drone takes off as soon as it has loaded.
        for drone in world.drones:
            drone.drops_instructions = True
        closure = await world.close("ZONE", area=BETWEEN_A_AND_B)
        for _ in range(20):
            await world.pass_time(timedelta(minutes=1))
            await world.check()

        await world.reopen(closure)
        await world.end()
