"""Look-ups of webhooks' names: a name server that does not answer delays its customer only."""

import asyncio
import threading
from collections.abc import Iterator, Sequence

import pytest
from skyway_gateway.notifications import post_webhook
from skyway_gateway.notifications.post_webhook import ForbiddenTarget, NameLookups, Targets

from skyway.ids import SubjectId
from skyway.runtime.errors import BudgetSpent

MALLORY, ALICE = SubjectId("mallory"), SubjectId("alice")
#: More than the threads that asyncio shares between all look-ups of a process.
MANY = 60


class SilentServer:
    """A resolver whose names below `silent.example` are not answered until `answers` is set."""

    def __init__(self) -> None:
        self.answers = threading.Event()
        self.asked: list[str] = []
        self.most_silent = 0
        self._silent = 0
        self._lock = threading.Lock()

    def find(self, host: str, _port: int) -> Sequence[str]:
        """The addresses of a host; it blocks like the system's resolver."""
        self.asked.append(host)
        if host.endswith(".silent.example"):
            with self._lock:
                self._silent += 1
                self.most_silent = max(self.most_silent, self._silent)
            self.answers.wait(30)
            with self._lock:
                self._silent -= 1
        return ["93.184.216.34"]


@pytest.fixture
def server() -> Iterator[SilentServer]:
    opened = SilentServer()
    yield opened
    opened.answers.set()


async def begun(lookups: NameLookups, names: int) -> list[asyncio.Task[Sequence[str]]]:
    """Many look-ups of one customer at the silent server, which have all begun or wait."""
    tasks = [
        asyncio.create_task(lookups.addresses(f"h{n}.silent.example", 443, MALLORY))
        for n in range(names)
    ]
    await asyncio.sleep(0)
    return tasks


async def test_names_of_one_customer_that_are_not_answered_delay_no_other(
    server: SilentServer,
) -> None:
    lookups = NameLookups(server.find)
    waiting = await begun(lookups, MANY)

    async with asyncio.timeout(10):
        assert await lookups.addresses("alice.example", 443, ALICE)
        assert await asyncio.get_running_loop().getaddrinfo("127.0.0.1", 80)

    server.answers.set()
    assert all(await asyncio.gather(*waiting))
    assert server.most_silent <= 4


async def test_a_look_up_whose_caller_has_left_keeps_its_turn(server: SilentServer) -> None:
    lookups = NameLookups(server.find)
    for task in await begun(lookups, MANY):
        task.cancel()
    await asyncio.sleep(0)

    waiting = asyncio.create_task(lookups.addresses("mallory.example", 443, MALLORY))
    async with asyncio.timeout(10):
        await lookups.addresses("alice.example", 443, ALICE)

    assert "mallory.example" not in server.asked
    server.answers.set()
    assert await waiting


async def test_one_name_is_looked_up_once_at_a_time(server: SilentServer) -> None:
    lookups = NameLookups(server.find)
    names = [lookups.addresses("h.silent.example", 443, MALLORY) for _ in range(MANY)]
    server.answers.set()

    assert all(await asyncio.gather(*names))
    assert server.asked == ["h.silent.example"]


async def test_no_more_names_of_a_customer_wait_than_are_allowed(server: SilentServer) -> None:
    lookups = NameLookups(server.find)
    waiting = await begun(lookups, 4 + 64)

    with pytest.raises(BudgetSpent):
        await lookups.addresses("h.example", 443, MALLORY)

    server.answers.set()
    assert all(await asyncio.gather(*waiting))


async def test_a_url_whose_name_is_not_answered_is_refused(
    server: SilentServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(post_webhook, "_LOOKUP_S", 0.05)
    targets = Targets(resolve=NameLookups(server.find).addresses)

    with pytest.raises(ForbiddenTarget, match="no name server answered"):
        await targets.check("https://h.silent.example/", MALLORY)


async def test_a_name_that_does_not_exist_has_no_address() -> None:
    assert await NameLookups().addresses("name.invalid.", 443, ALICE) == ()
