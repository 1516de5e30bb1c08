"""The cells of a local system: further servers of composition, each with a database of its own.

The table of cells has the addresses of the servers, so a server has the same port at every start. A
file in the data folder keeps the ports.
"""

import json
import socket
from collections.abc import Mapping

from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import DataFolder


def cell_names(count: int) -> list[str]:
    """The names of so many cells."""
    return [f"cell-{number}" for number in range(1, count + 1)]


def kept_ports(folder: DataFolder, count: int = 0) -> tuple[int, ...]:
    """The port of each cell: first the kept ones, and then 0 for new ones up to this count.

    Cells that were started once are always started: they may serve networks.
    """
    file = folder.cells_file
    kept: list[int] = json.loads(file.read_text()) if file.exists() else []
    return (*kept, *[0] * (count - len(kept)))


def keep_ports(folder: DataFolder, sockets: Mapping[str, socket.socket]) -> None:
    """Keep the ports of the cells among these sockets for the next start."""
    names = [name for name in cell_names(len(sockets)) if name in sockets]
    if names:
        ports = [sockets[name].getsockname()[1] for name in names]
        write_private(folder.cells_file, json.dumps(ports))
