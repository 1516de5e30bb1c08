"""SQL that copies rows many times: other ids, earlier times, in one statement for each table."""

from collections.abc import Mapping, Sequence
from typing import Final

from sqlalchemy import BigInteger, Column, Table, Text

#: An id has 26 characters after its prefix. Zeros sort before all that services make.
_ZEROS: Final = "0" * 19

#: Milliseconds between two copies, in the order of their numbers.
_APART_MS: Final = 50


def copy_id(prefix: str) -> str:
    """The SQL of the id of copy `n.i`: the same length as other ids, and in the same order."""
    return f"'{prefix}_{_ZEROS}' || substr(CAST(10000000 + n.i AS TEXT), 2)"


def part_id(prefix: str, number: str) -> str:
    """The SQL of the id of a part of copy `n.i`; `number` is a column that counts the parts."""
    two = f"substr(CAST(100 + old.{number} AS TEXT), 2)"
    return f"'{prefix}_{_ZEROS[2:]}' || substr(CAST(10000000 + n.i AS TEXT), 2) || {two}"


def copying(
    table: Table,
    *,
    where: str,
    numbers: range,
    copies: int,
    ids: Mapping[str, str],
    columns: Mapping[str, str],
    drone_ids: Sequence[str],
) -> str:
    """The statement that makes the copies of these numbers, of `copies` in all.

    It copies the rows `where` a condition holds.

    In every text an id of `ids` is replaced by its SQL. `columns` are set to their own SQL. The
    copies take turns with these drones, as `fleet.drone_id`.
    """
    fleet = ", ".join(f"({number}, '{each}')" for number, each in enumerate(drone_ids))
    values = [columns.get(each.name) or _value(each, ids, copies) for each in table.c]
    names = ", ".join(each.name for each in table.c)
    return (
        f"WITH RECURSIVE n(i) AS (SELECT {numbers.start} UNION ALL "
        f"SELECT i + 1 FROM n WHERE i < {numbers.stop - 1}), "
        f"fleet(number, drone_id) AS (VALUES {fleet}) "
        f"INSERT INTO {table.name} ({names}) SELECT {', '.join(values)} "
        f"FROM n JOIN fleet ON fleet.number = n.i % {len(drone_ids)} "
        f"CROSS JOIN {table.name} AS old WHERE {where}"
    )


def _value(column: Column[object], ids: Mapping[str, str], copies: int) -> str:
    own = f"old.{column.name}"
    if isinstance(column.type, Text):
        for old, new in ids.items():
            own = f"replace({own}, '{old}', {new})"
    elif isinstance(column.type, BigInteger) and _is_fleet_time(column.name):
        return f"{own} - ({copies} - n.i) * {_APART_MS}"
    return own


def _is_fleet_time(name: str) -> bool:
    return name.endswith("_ms") and not name.endswith("_wall_ms") and name != "claimed_until_ms"
