"""The newest warnings and errors of this process, one entry for each kind, for operators."""

import logging
import threading
from collections import OrderedDict
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Final

from skyway.contracts.figures import LoggedError
from skyway.runtime.tracing import current_trace_id

#: Kinds that are kept. One kind is one text in the code, with any values filled in.
MOST_KINDS: Final = 20
#: Characters of a text that are kept.
_LONGEST_TEXT: Final = 300


class LastErrors(logging.Handler):
    """Counts log records from WARNING on by kind, and keeps the newest record of each kind."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self._kinds: OrderedDict[tuple[str, str], LoggedError] = OrderedDict()
        # Records come from other threads too.
        self._guard = threading.Lock()

    def emit(self, record: logging.LogRecord) -> None:
        """Note a record; with too many kinds, the kind with the oldest record is forgotten."""
        try:
            self._note(record)
        except (TypeError, ValueError, KeyError):
            # A text whose values do not fit is reported, and does not stop the work.
            self.handleError(record)

    def _note(self, record: logging.LogRecord) -> None:
        kind = (record.name, str(record.msg))
        with self._guard:
            earlier = self._kinds.pop(kind, None)
            self._kinds[kind] = LoggedError(
                at=datetime.fromtimestamp(record.created, UTC),
                level=record.levelname,
                event=record.getMessage()[:_LONGEST_TEXT],
                reason=_reason_of(record),
                times=1 if earlier is None else earlier.times + 1,
                trace_id=current_trace_id(),
            )
            if len(self._kinds) > MOST_KINDS:
                self._kinds.popitem(last=False)

    def newest(self) -> Sequence[LoggedError]:
        """The newest record of each kind, the newest kind first."""
        with self._guard:
            return tuple(reversed(self._kinds.values()))


def _reason_of(record: logging.LogRecord) -> str | None:
    error = record.exc_info[1] if record.exc_info else None
    return None if error is None else f"{type(error).__name__}: {error}"[:_LONGEST_TEXT]


#: The warnings and errors of this process.
LAST_ERRORS: Final = LastErrors()
