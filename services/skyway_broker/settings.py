"""The settings that the broker reads from its environment."""

import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from skyway.runtime.errors import InvalidSettings
from skyway_broker.limits import (
    CONNECTIONS,
    CONNECTIONS_PER_ADDRESS,
    Limits,
    allowed_connections,
)


@dataclass(frozen=True, slots=True)
class BrokerSettings:
    """Where the broker listens, and the file of its accounts."""

    #: The file of accounts that the registry writes.
    password_file: Path
    #: Address on which the broker listens.
    host: str = "127.0.0.1"
    #: 0 takes any free port.
    port: int = 0
    #: A listening socket that the parent process passes. It replaces host and port.
    socket_fd: int | None = None
    #: A pipe to the parent process. The broker ends when it closes.
    parent_fd: int | None = None
    #: Open connections in all; fewer where the system allows fewer open files.
    connections: int = CONNECTIONS
    #: Open connections of one address.
    connections_per_address: int = CONNECTIONS_PER_ADDRESS
    log_level: str = "INFO"

    @classmethod
    def load(cls) -> Self:
        """The settings of this process.

        Raises
        ------
        InvalidSettings
            Naming the variable that is missing or wrong.
        """
        password_file = os.environ.get("SKYWAY_BROKER_PASSWORD_FILE")
        if not password_file:
            raise InvalidSettings("SKYWAY_BROKER_PASSWORD_FILE: is missing")
        return cls(
            password_file=Path(password_file),
            host=os.environ.get("SKYWAY_BROKER_HOST", "127.0.0.1"),
            port=_number("SKYWAY_BROKER_PORT") or 0,
            socket_fd=_number("SKYWAY_SOCKET_FD"),
            parent_fd=_number("SKYWAY_PARENT_FD"),
            connections=_number("SKYWAY_BROKER_CONNECTIONS") or CONNECTIONS,
            connections_per_address=_number("SKYWAY_BROKER_CONNECTIONS_PER_ADDRESS")
            or CONNECTIONS_PER_ADDRESS,
            log_level=os.environ.get("SKYWAY_LOG_LEVEL", "INFO"),
        )

    def limits(self) -> Limits:
        """The limits of this process, within its open files."""
        connections = allowed_connections(self.connections)
        # One address alone must not fill the broker where the system allows few files.
        per_address = min(self.connections_per_address, max(connections // 2, 1))
        return Limits(connections=connections, connections_per_address=per_address)

    def listener(self) -> socket.socket:
        """The socket to listen on."""
        if self.socket_fd is not None:
            return socket.socket(fileno=self.socket_fd)
        return socket.create_server((self.host, self.port))


def _number(variable: str) -> int | None:
    value = os.environ.get(variable, "")
    if value == "":
        return None
    if not value.isdecimal():
        raise InvalidSettings(f"{variable}: {value!r} is not a number")
    return int(value)
