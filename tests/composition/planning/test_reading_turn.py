"""Large problems are read one at a time, also when their callers leave."""

import asyncio
import threading

import pytest
from skyway_composition.planning.reading_turn import ReadingTurn


async def test_a_caller_that_leaves_while_it_waits_is_never_read() -> None:
    turn, may_end, begun = ReadingTurn(), threading.Event(), list[str]()

    def read(name: str) -> str:
        begun.append(name)
        may_end.wait(60)
        return name

    first = asyncio.create_task(turn.run(read, "first"))
    others = [asyncio.create_task(turn.run(read, f"other {n}")) for n in range(40)]
    while not begun:  # noqa: ASYNC110 - of a thread
        await asyncio.sleep(0)
    for each in (first, *others):
        each.cancel()
    await asyncio.sleep(0)
    may_end.set()
    last = await turn.run(read, "last")

    assert last == "last"
    assert begun == ["first", "last"]
    with pytest.raises(asyncio.CancelledError):
        await first


async def test_an_error_of_the_reader_is_raised() -> None:
    with pytest.raises(ValueError, match="invalid literal"):
        await ReadingTurn().run(int, "x")
