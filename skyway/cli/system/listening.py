"""Listening sockets that the supervisor passes to its children."""

import socket

from skyway.cli.system.patience import NotNow


def listen(host: str, port: int, *, purpose: str) -> socket.socket:
    """A listening socket to pass to a child; port 0 is any free port.

    Raises
    ------
    NotNow
        The port is in use; the message names the port and its purpose.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as error:
        listener.close()
        raise NotNow(f"port {port} for {purpose} cannot be used: {error.strerror}") from error
    listener.listen(1024)
    return listener
