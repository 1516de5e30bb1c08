"""The settings that the broker reads from its environment."""

import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from skyway.runtime.errors import InvalidSettings


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
            raise InvalidSettings("SKYWAY_BROKER_PASSWORD_FILE: Field required")
        return cls(
            password_file=Path(password_file),
            host=os.environ.get("SKYWAY_BROKER_HOST", "127.0.0.1"),
            port=_number("SKYWAY_BROKER_PORT") or 0,
            socket_fd=_number("SKYWAY_SOCKET_FD"),
            parent_fd=_number("SKYWAY_PARENT_FD"),
            log_level=os.environ.get("SKYWAY_LOG_LEVEL", "INFO"),
        )

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
