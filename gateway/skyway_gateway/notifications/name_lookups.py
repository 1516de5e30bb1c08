"""Looks up the host names of webhooks, in turns of their customers.

A name server that does not answer keeps its thread for as long as the system's resolver waits, half
a minute or more. So these look-ups have threads of their own, and one customer has few of them: the
process's other look-ups, and those of other customers, go on.
"""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable, Sequence
from typing import Final

from skyway.ids import SubjectId
from skyway.runtime.limits import FairQueue

#: The addresses that the system's resolver finds; empty when there are none.
FindByDns = Callable[[str, int], Sequence[str]]

_AT_ONCE: Final = 64
_OF_ONE_CUSTOMER: Final = 4
_MOST_WAITING: Final = 64

_Name = tuple[SubjectId, str, int]


class NameLookups:
    """The look-ups of one process. `find` blocks its thread."""

    def __init__(self, find: FindByDns | None = None) -> None:
        self._find = find or _find_by_dns
        self._turns = FairQueue(
            "LOOKUPS", at_once=_AT_ONCE, per_tenant=_OF_ONE_CUSTOMER, most_waiting=_MOST_WAITING
        )
        self._under_way: dict[_Name, asyncio.Task[Sequence[str]]] = {}

    async def addresses(self, host: str, port: int, customer_id: SubjectId) -> Sequence[str]:
        """The addresses of a host, as text; empty when there are none.

        A caller that stops waiting leaves its look-up running: its thread is busy until then.

        Raises
        ------
        BudgetSpent
            So many names of the customer wait that no more may.
        """
        name = customer_id, host, port
        if name not in self._under_way:
            task = self._under_way[name] = asyncio.create_task(self._in_turn(name))
            task.add_done_callback(lambda _: self._under_way.pop(name))
        return await asyncio.shield(self._under_way[name])

    async def _in_turn(self, name: _Name) -> Sequence[str]:
        customer_id, host, port = name
        async with self._turns.turn(customer_id):
            return await _in_thread(lambda: self._find(host, port))


async def _in_thread(find: Callable[[], Sequence[str]]) -> Sequence[str]:
    """What `find` returns, in a thread that does not hold up the end of the process."""
    loop = asyncio.get_running_loop()
    found: asyncio.Future[Sequence[str]] = loop.create_future()

    def work() -> None:
        addresses = find()
        with contextlib.suppress(RuntimeError):  # the loop may have ended by now
            loop.call_soon_threadsafe(_answer, found, addresses)

    threading.Thread(target=work, name="look up a name", daemon=True).start()
    return await found


def _answer(found: asyncio.Future[Sequence[str]], addresses: Sequence[str]) -> None:
    if not found.done():
        found.set_result(addresses)


def _find_by_dns(host: str, port: int) -> Sequence[str]:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return ()
    return [str(address[0]) for *_, address in found]
