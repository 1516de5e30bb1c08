"""The cells of a local system: networks with a composition and a database of their own.

A file in the data folder keeps their networks, because later starts need their databases.
"""

import json
from collections.abc import Mapping, Sequence

from skyway.broker_setup.private_file import write_private
from skyway.cli.data_folder import DataFolder


def cells_of(folder: DataFolder, networks: Sequence[str] = ()) -> Mapping[str, str]:
    """The network of each cell by the cell's name: the kept cells, and after them new ones."""
    file = folder.cells_file
    kept: list[str] = json.loads(file.read_text()) if file.exists() else []
    every = dict.fromkeys([*kept, *networks])
    return {f"cell-{number}": network for number, network in enumerate(every, start=1)}


def keep_cells(folder: DataFolder, cells: Mapping[str, str]) -> None:
    """Keep these cells for the next start."""
    if cells:
        write_private(folder.cells_file, json.dumps([*cells.values()]))
