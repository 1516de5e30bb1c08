"""Results as CSV: a row for every run, in the order in which the trials were drawn."""

import csv
from collections.abc import Sequence
from pathlib import Path

from skyway.experiments.section import Row


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write the rows; all have the columns of the first."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
