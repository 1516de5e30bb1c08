"""Runs the search for a better order in a process of its own, which is kept for the next search.

That process runs `serve`. It reads searches from its standard input and ends when the input is
closed, so it does not outlive its parent.
"""

import asyncio
import os
import pickle
import select
import struct
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Final, Never, Self

from skyway.errors import SkywayError
from skyway.ids import DroneId, MissionId, NetworkId
from skyway.network.network import Network
from skyway.runtime.errors import exit_code_after

#: The length of a message, before it.
_LENGTH: Final = struct.Struct("!Q")

#: Seconds of wall time for one search. A machine that has not compiled the dispatcher needs a
#: minute for the first one.
_LONGEST_S: Final = 240.0
#: Seconds of wall time for an idle process to end.
_ENDS_WITHIN_S: Final = 2.0

#: How much the process gives way to the others of its machine.
_NICENESS: Final = 5

#: The share of the machine's processor time that searches take at most. Our own choice: a second of
#: search saves many fleets less than the bookings that would wait for it.
_MOST_SHARE: Final = 0.025


class SearchFailed(SkywayError):
    """The search ended without a result."""


@dataclass(frozen=True, slots=True)
class FoundOrder:
    """The order of the missions of each drone, and the processor time of the search.

    It is not complete if some mission found no place. `shared` has the missions of each shared
    trip; in the order they follow one another.
    """

    orders: Mapping[DroneId, tuple[MissionId, ...]]
    is_complete: bool
    processor_s: float
    shared: tuple[tuple[MissionId, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class Search:
    """A fleet problem without its network, the processor time for it, and a seed."""

    network_id: NetworkId
    version: int
    fields: Mapping[str, Any]  # the fields of FleetProblem
    budget_s: float
    seed: int


class SearchProcess:
    """Searches one after another; `find` may be called by one task at a time."""

    def __init__(self, *, now: Callable[[], float] = time.monotonic) -> None:
        self._process: asyncio.subprocess.Process | None = None
        self._known: tuple[NetworkId, int] | None = None
        self._now = now
        self._rested_s = 0.0

    @property
    def rest_s(self) -> float:
        """Seconds of wall time to wait before the next fleet is searched."""
        return max(0.0, self._rested_s - self._now())

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self._end()

    async def find(self, search: Search, network: Network) -> FoundOrder:
        """The best order that the search finds.

        Raises
        ------
        SearchFailed
            The process has ended, or takes too long. The next search begins another one.
        """
        began_s = max(self._rested_s, self._now())
        try:
            async with asyncio.timeout(_LONGEST_S):
                answer = await self._ask(search, network)
        except (TimeoutError, OSError, asyncio.IncompleteReadError) as error:
            await self._end()
            raise SearchFailed(f"the search process has ended: {error!r}") from error
        except asyncio.CancelledError:
            await self._end()
            raise
        if isinstance(answer, FoundOrder):
            allowed = _MOST_SHARE * (os.cpu_count() or 1)
            self._rested_s = began_s + answer.processor_s / allowed
            return answer
        raise SearchFailed(str(answer))

    async def _ask(self, search: Search, network: Network) -> object:
        process = await self._running()
        if process.stdin is None or process.stdout is None:
            raise SearchFailed("the search process has no pipes")
        key = search.network_id, search.version
        sent = (search, None if self._known == key else network)
        # A large network takes long to pack.
        text = await asyncio.to_thread(pickle.dumps, sent)
        process.stdin.write(_LENGTH.pack(len(text)) + text)
        await process.stdin.drain()
        self._known = key
        (length,) = _LENGTH.unpack(await process.stdout.readexactly(_LENGTH.size))
        return pickle.loads(await process.stdout.readexactly(length))  # noqa: S301 - our own child

    async def _running(self) -> asyncio.subprocess.Process:
        if self._process is None or self._process.returncode is not None:
            await self._end()
            self._process = await asyncio.create_subprocess_exec(
                sys.executable,
                "-c",
                f"from {__name__} import serve; serve()",
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
            )
        return self._process

    async def _end(self) -> None:
        process, self._process, self._known = self._process, None, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        with suppress(TimeoutError):
            async with asyncio.timeout(_ENDS_WITHIN_S):
                await process.wait()
                return
        with suppress(ProcessLookupError):
            process.kill()
        await process.wait()


def answer(search: Search, network: Network, *, rounds: int | None = None) -> FoundOrder | str:
    """The order that a search finds; a text says why there is none.

    With `rounds` the same search finds the same order on every machine.
    """
    # Imported here: composition itself does without the search.
    from skyway.dispatch.optimise import optimise
    from skyway.dispatch.problem import FleetProblem

    began_s = time.process_time()
    try:
        problem = FleetProblem(network=network, **search.fields)
        plan = optimise(problem, budget_s=search.budget_s, rounds=rounds, seed=search.seed)
    except (SkywayError, ValueError) as error:
        return str(error)
    orders: dict[DroneId, list[MissionId]] = {each.drone_id: [] for each in problem.drones}
    shared = []
    for trip in plan.trips:
        missions = tuple(MissionId(one.request_id) for one in trip.requests)
        orders[trip.drone_id] += missions
        if len(missions) > 1:
            shared.append(missions)
    return FoundOrder(
        {drone_id: tuple(order) for drone_id, order in orders.items()},
        not plan.unserved,
        time.process_time() - began_s,
        tuple(shared),
    )


def _end_with_parent() -> None:
    """End the process when its input is closed, also in the middle of a search."""
    closing = select.poll()
    closing.register(sys.stdin.fileno(), 0)
    closing.poll()
    os._exit(0)


def serve() -> Never:
    """Answer the searches on standard input until it ends, behind the work of other processes."""
    sys.exit(exit_code_after("search", _serve))


def _serve() -> None:
    from skyway.dispatch.warm import warm

    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.nice(_NICENESS)
    # Loading the compiled search would use up the budget of the first search.
    warm()
    source, target = sys.stdin.buffer, sys.stdout.buffer
    network: Network | None = None
    with suppress(KeyboardInterrupt):
        while head := source.read(_LENGTH.size):
            (length,) = _LENGTH.unpack(head)
            search, newer = pickle.loads(source.read(length))  # noqa: S301 - from our parent
            network = newer or network
            found = "no network was sent" if network is None else answer(search, network)
            text = pickle.dumps(found)
            target.write(_LENGTH.pack(len(text)) + text)
            target.flush()
