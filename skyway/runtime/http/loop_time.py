"""What a request costs: how long it keeps the event loop busy, and how many bytes it moves."""

import time
import types
from collections.abc import Callable, Coroutine, Generator
from typing import Any, Final, TypeVar

from starlette.types import Scope

from skyway.runtime.limits import Meter

#: Any: what a coroutine yields belongs to asyncio, which sends nothing back.
T = TypeVar("T")

#: What one unit of a budget pays for: seconds of the event loop, or bytes of a body or an answer.
UNIT_S: Final = 0.005
UNIT_BYTES: Final = 64 * 1024


class Account:
    """Charges a caller for the work of one request, beyond the unit that its admission has cost."""

    def __init__(
        self, meter: Meter, who: str, now: Callable[[], float] = time.perf_counter
    ) -> None:
        self._meter = meter
        self._who = who
        self._now = now
        self._owed = -1.0

    def add_bytes(self, size_bytes: int) -> None:
        """Charge these bytes."""
        self._add(size_bytes / UNIT_BYTES)

    def _add(self, units: float) -> None:
        self._owed += units
        if self._owed > 0.0:
            self._meter.charge(self._who, self._owed)
            self._owed = 0.0

    async def measured(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of the coroutine; the time between its waits is charged."""
        return await self._steps(work)

    @types.coroutine
    def _steps(self, work: Coroutine[Any, Any, T]) -> Generator[Any, Any, T]:
        thrown: BaseException | None = None
        while True:
            began_s = self._now()
            try:
                waits_for = work.send(None) if thrown is None else work.throw(thrown)
            except StopIteration as end:
                result: T = end.value
                return result
            finally:
                self._add((self._now() - began_s) / UNIT_S)
            try:
                yield waits_for
                thrown = None
            except BaseException as error:  # noqa: BLE001 - the coroutine decides about it
                thrown = error


def charged(scope: Scope, work: Coroutine[Any, Any, T]) -> Coroutine[Any, Any, T]:
    """The work, measured for the account of this request, if it has one."""
    account: Account | None = scope.get("state", {}).get("account")
    return work if account is None else account.measured(work)
