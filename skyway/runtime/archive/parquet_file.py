"""One Parquet file: it appears whole under its name, or not at all."""

import os
from collections.abc import AsyncIterator, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Boolean, Column, Double, Integer, LargeBinary

from skyway.runtime.errors import InvalidSettings

#: Rows that are in memory at a time, and in one group of the file.
_ROWS_IN_GROUP: Final = 10_000


async def write_parquet(
    path: Path, columns: Iterable[Column[Any]], rows: AsyncIterator[Sequence[Any]]
) -> int:
    """Write a file of these columns; how many rows it has. Any: columns have every type.

    Raises
    ------
    InvalidSettings
        PyArrow is not installed.
    """
    try:
        import pyarrow
        from pyarrow.parquet import ParquetWriter
    except ImportError as error:
        raise InvalidSettings("the archive needs `pip install 'skyway[archive]'`") from error
    schema = pyarrow.schema([(each.name, _arrow_type(each)) for each in columns])
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    count = 0
    with ParquetWriter(unfinished, schema, compression="zstd") as writer:
        group: list[Sequence[Any]] = []
        async for row in rows:
            group.append(row)
            count += 1
            if len(group) == _ROWS_IN_GROUP:
                writer.write_table(_table(schema, group))
                group = []
        if group:
            writer.write_table(_table(schema, group))
    _sync(unfinished)
    unfinished.rename(path)
    return count


def _table(schema: Any, rows: Sequence[Sequence[Any]]) -> Any:  # PyArrow has no types
    import pyarrow

    columns = zip(*rows, strict=True)
    arrays = [
        pyarrow.array(values, type=each.type) for values, each in zip(columns, schema, strict=True)
    ]
    return pyarrow.Table.from_arrays(arrays, schema=schema)


def _arrow_type(column: Column[Any]) -> Any:  # PyArrow has no types
    import pyarrow

    if isinstance(column.type, Boolean):
        return pyarrow.bool_()
    if isinstance(column.type, Integer):
        return pyarrow.int64()
    if isinstance(column.type, Double):
        return pyarrow.float64()
    return pyarrow.binary() if isinstance(column.type, LargeBinary) else pyarrow.string()


def _sync(path: Path) -> None:
    """Wait until the file is on disk: rows may be deleted from the database afterwards."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
