"""The limits of what callers may send, as the settings of a process ask for them."""

from dataclasses import dataclass

import pytest

from skyway.runtime.http.front.front_limits import FrontLimits


@dataclass(frozen=True)
class Settings:
    """What an operator asks for."""

    http_connections: int = 200
    http_connections_per_address: int = 50
    http_url_bytes: int = 1_000
    http_head_bytes: int = 4_000
    http_head_s: float = 10.0
    http_body_s: float = 20.0


@pytest.mark.parametrize(("asked", "given"), [(50, 50), (100, 100), (101, 100), (1_000, 100)])
def test_no_setting_gives_one_address_more_than_half_of_the_connections(
    asked: int, given: int
) -> None:
    limits = FrontLimits.of(Settings(http_connections_per_address=asked))

    assert (limits.connections, limits.per_address) == (200, given)


def test_a_process_has_no_more_connections_than_its_open_files_allow() -> None:
    limits = FrontLimits.of(Settings(http_connections=10_000_000))

    assert limits.connections < 10_000_000
