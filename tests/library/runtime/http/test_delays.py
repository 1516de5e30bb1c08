"""Callers who go on after their budget is spent are slowed, without harm for anybody else."""

import asyncio

import pytest

from skyway.runtime.http.delays import Brake, WrongKeys


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

    above = asyncio.ensure_future(brake.hold())
    await asyncio.sleep(0)

    is_free = above.done()
    for each in (held, above):
        each.cancel()
    await asyncio.gather(held, above, return_exceptions=True)
    assert is_free


async def test_a_caller_who_leaves_makes_room_for_the_next() -> None:
    brake = Brake(held_s=3600, most_held=1)
    for _ in range(3):
        held = asyncio.ensure_future(brake.hold())
        await asyncio.sleep(0)
        assert not held.done()
        held.cancel()
        await asyncio.gather(held, return_exceptions=True)


class Seconds:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def seconds() -> Seconds:
    return Seconds()


def waits(wrong_keys: WrongKeys, seconds: Seconds, number: int) -> list[float]:
    """The wait after each of so many wrong keys, each shown after the wait of the one before."""
    found = []
    for _ in range(number):
        wrong_keys.note("a")
        found.append(wrong_keys.wait_s("a"))
        seconds.now += found[-1]
    return found


def test_the_first_ten_wrong_keys_are_free_and_then_the_wait_doubles(seconds: Seconds) -> None:
    found = waits(WrongKeys(now=seconds), seconds, 20)

    assert found[:9] == [0.0] * 9
    assert found[9:] == [0.5, 1, 2, 4, 8, 16, 32, 60, 60, 60, 60]


def test_the_wait_stays_bounded_after_any_number_of_wrong_keys(seconds: Seconds) -> None:
    assert waits(WrongKeys(now=seconds), seconds, 5000)[-1] == 60


def test_another_address_does_not_wait(seconds: Seconds) -> None:
    wrong_keys = WrongKeys(now=seconds)
    waits(wrong_keys, seconds, 20)
    wrong_keys.note("a")

    assert wrong_keys.wait_s("a") > 0
    assert wrong_keys.wait_s("b") == 0


def test_wrong_keys_are_forgotten_after_ten_minutes(seconds: Seconds) -> None:
    wrong_keys = WrongKeys(now=seconds)
    waits(wrong_keys, seconds, 20)
    seconds.now += 539  # after the last wait of 60 s
    wrong_keys.note("a")
    assert wrong_keys.wait_s("a") == 60

    seconds.now += 600
    wrong_keys.note("a")

    assert wrong_keys.wait_s("a") == 0


def test_the_memory_is_bounded_and_forgets_the_longest_silent(seconds: Seconds) -> None:
    wrong_keys = WrongKeys(most=100, now=seconds)
    waits(wrong_keys, seconds, 20)
    for number in range(1000):
        wrong_keys.note(f"address {number}")
        if number % 50 == 0:
            wrong_keys.note("a")

    assert wrong_keys.remembered == 100
    assert wrong_keys.wait_s("a") > 0
