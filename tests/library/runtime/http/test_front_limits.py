"""The limits of what callers may send, as the settings of a process ask for them."""

from dataclasses import dataclass, field

import pytest

from skyway.runtime.http.front_limits import ConnectionTable, FrontLimits
from skyway.runtime.settings import ServiceSettings


def make_settings(*, connections: int = 200, per_address: int = 50) -> ServiceSettings:
    return ServiceSettings.model_construct(
        http_connections=connections, http_connections_per_address=per_address
    )


@pytest.mark.parametrize(("asked", "given"), [(50, 50), (100, 100), (101, 100), (1_000, 100)])
def test_no_setting_gives_one_address_more_than_half_of_the_connections(
    asked: int, given: int
) -> None:
    limits = FrontLimits.of(make_settings(per_address=asked))

    assert (limits.connections, limits.per_address) == (200, given)


def test_a_process_has_no_more_connections_than_its_open_files_allow() -> None:
    limits = FrontLimits.of(make_settings(connections=10_000_000))

    assert limits.connections < 10_000_000


LIMITS = FrontLimits(
    connections=6, per_address=3, url_bytes=1, head_bytes=1, head_s=1.0, body_s=1.0
)


@dataclass(eq=False)
class Connection:
    """Leaves the table when it is closed, as a real one does."""

    table: ConnectionTable
    host: str
    name: str | None = field(init=False)
    is_closed: bool = False

    def __post_init__(self) -> None:
        self.name = self.table.enter(self, self.host)

    def close_waiting(self) -> None:
        self.is_closed = True
        self.leave()

    def use(self) -> "Connection":
        assert self.name is not None
        self.table.use(self, self.name)
        return self

    def wait(self) -> None:
        assert self.name is not None
        self.table.wait(self, self.name)

    def leave(self) -> None:
        assert self.name is not None
        self.table.leave(self, self.name)


@pytest.fixture
def table() -> ConnectionTable:
    return ConnectionTable(LIMITS)


def test_the_address_with_too_many_loses_its_longest_waiting_connection(
    table: ConnectionTable,
) -> None:
    other = Connection(table, "10.0.0.1")
    crowd = [Connection(table, "10.0.0.2") for _ in range(4)]

    assert [each.is_closed for each in crowd] == [True, False, False, False]
    assert not other.is_closed
    assert table.open == 4


def test_a_connection_in_use_is_not_closed(table: ConnectionTable) -> None:
    used = Connection(table, "10.0.0.2").use()
    waiting = [Connection(table, "10.0.0.2") for _ in range(3)]

    assert not used.is_closed
    assert [each.is_closed for each in waiting] == [True, False, False]


def test_a_new_connection_is_refused_if_all_of_its_address_are_in_use(
    table: ConnectionTable,
) -> None:
    used = [Connection(table, "10.0.0.2").use() for _ in range(3)]

    refused = Connection(table, "10.0.0.2")

    assert refused.name is None
    assert not any(each.is_closed for each in used)
    assert Connection(table, "10.0.0.3").name is not None


def test_a_connection_that_was_in_use_waits_behind_the_others(table: ConnectionTable) -> None:
    first = Connection(table, "10.0.0.2").use()
    second = Connection(table, "10.0.0.2")
    first.wait()
    Connection(table, "10.0.0.2")
    Connection(table, "10.0.0.2")

    assert second.is_closed
    assert not first.is_closed


def test_many_addresses_close_what_waits_longest_of_all(table: ConnectionTable) -> None:
    many = [Connection(table, f"10.0.1.{number}") for number in range(9)]

    assert [each.is_closed for each in many] == [True] * 3 + [False] * 6
    assert table.open == 6


def test_a_full_process_refuses_an_address_that_it_does_not_know(table: ConnectionTable) -> None:
    for number in range(6):
        Connection(table, f"10.0.1.{number}").use()

    assert Connection(table, "10.0.2.1").name is None
    assert table.open == 6


def test_the_addresses_of_one_ipv6_network_count_together(table: ConnectionTable) -> None:
    crowd = [Connection(table, f"2001:db8::{number}") for number in range(4)]

    assert crowd[0].is_closed


def test_a_trusted_proxy_may_have_all_connections() -> None:
    table = ConnectionTable(LIMITS, trusted_proxies="10.9.0.0/16, 10.8.0.1")

    of_proxy = [Connection(table, "10.9.1.1") for _ in range(6)]

    assert not any(each.is_closed for each in of_proxy)


def test_nothing_is_kept_of_addresses_that_left(table: ConnectionTable) -> None:
    for number in range(1_000):
        Connection(table, f"10.0.{number // 250}.{number % 250}").use().leave()
    for number in range(1_000):
        Connection(table, f"10.1.{number // 250}.{number % 250}")

    assert table.open == 6
    assert len(table._addresses) == 6
