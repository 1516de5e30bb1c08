"""Booking on both databases: all or nothing, and nothing twice."""

import asyncio
from datetime import timedelta

import pytest

from skyway.contracts.flight_step import RechargeStep
from skyway.contracts.instruction import MissionInstruction


async def test_a_booking_holds_the_drone_and_the_pads_and_sends_the_mission(composition) -> None:
    booking = await composition.book()

    assert booking.outcome == "BOOKED"
    (mission,) = booking.missions
    (instruction,) = await composition.sent()
    assert instruction.mission_id == mission.mission_id
    assert (instruction.stream, instruction.seq) == (1, 1)
    assert {row.mission_id for row in await composition.reservations()} == {mission.mission_id}
    assert await composition.broken() == []
