"""Callers who go on after their budget is spent are slowed, without harm for anybody else."""

import asyncio

from skyway.runtime.http.brake import Brake


async def test_an_answer_is_held_back() -> None:
    held = asyncio.ensure_future(Brake(held_s=3600).hold())
    await asyncio.sleep(0)

    assert not held.done()
    held.cancel()
    await asyncio.gather(held, return_exceptions=True)


async def test_answers_above_the_limit_are_not_held_back() -> None:
    brake = Brake(held_s=3600, most_held=1)
    held = asyncio.ensure_future(brake.hold())
    await asyncio.sleep(0)

    await brake.hold()

    held.cancel()
    await asyncio.gather(held, return_exceptions=True)


async def test_a_caller_who_leaves_makes_room_for_the_next() -> None:
    brake = Brake(held_s=3600, most_held=1)
    for _ in range(3):
        held = asyncio.ensure_future(brake.hold())
        await asyncio.sleep(0)
        assert not held.done()
        held.cancel()
        await asyncio.gather(held, return_exceptions=True)
