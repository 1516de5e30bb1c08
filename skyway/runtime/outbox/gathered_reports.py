"""Reports that travel in one request, each with the trace that it belongs to."""

import asyncio
import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from sqlalchemy import Row

#: Half of what a service takes in one body.
_LARGEST_BYTES: Final = 128 * 1024


class GatheredReports:
    """Rows of the outbox for one path of one service, posted by whoever came first.

    Any: the rows have the columns of `outbox_table`.
    """

    def __init__(self, first: Row[Any]) -> None:
        self._rows = [first]
        self._bytes = len(first.payload)
        self._taken: asyncio.Future[bool] = asyncio.get_running_loop().create_future()

    @property
    def is_one(self) -> bool:
        """Whether nothing came to the first."""
        return len(self._rows) == 1

    def take(self, row: Row[Any]) -> bool:
        """Let a row come along; False when there is no room for it."""
        self._bytes += len(row.payload)
        if self._bytes > _LARGEST_BYTES:
            return False
        self._rows.append(row)
        return True

    def body(self) -> bytes:
        """The JSON of all, as `skyway.contracts.mission_reports` has it."""
        return b'{"reports":[' + b",".join(map(_traced, self._rows)) + b"]}"

    @contextmanager
    def being_posted(self) -> Iterator[None]:
        """Whoever waits is answered when the block is left, with False unless they were taken."""
        try:
            yield
        finally:
            if not self._taken.done():
                self._taken.set_result(False)

    def were_taken(self) -> None:
        """The service has answered that it took all of them."""
        self._taken.set_result(True)

    async def taken(self) -> bool:
        """Wait until they were posted; whether the service took them."""
        return await asyncio.shield(self._taken)


def _traced(row: Row[Any]) -> bytes:
    trace = json.dumps(row.traceparent).encode()
    payload: bytes = row.payload
    return b'{"traceparent":' + trace + b',"report":' + payload + b"}"
