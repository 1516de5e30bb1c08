"""A port that is in use is named, and waited for."""

import socket
from contextlib import ExitStack

import pytest

from skyway.cli.system.children import Ports, bind_when_free, listen
from skyway.cli.system.retry import NotNow


def test_a_taken_port_is_named_with_its_purpose() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]

        with pytest.raises(NotNow, match=rf"port {port} for the gateway"):
            listen("127.0.0.1", port, purpose="the gateway")


async def test_a_port_of_a_process_that_still_leaves_is_waited_for() -> None:
    said: list[str] = []
    leaving = socket.create_server(("127.0.0.1", 0))
    port = leaving.getsockname()[1]

    def say(line: str) -> None:
        said.append(line)
        leaving.close()

    with ExitStack() as held:
        sockets = await bind_when_free(Ports(gateway=port, broker=0), held, say=say)

        assert sockets["gateway"].getsockname()[1] == port
    assert len(said) == 1
    assert f"port {port} for the gateway cannot be used" in said[0]
