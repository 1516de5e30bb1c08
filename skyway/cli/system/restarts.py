"""When a process that ended is started again, and why it ended."""

import signal
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from skyway.runtime.errors import FOR_GOOD, ExitCode

#: Seconds of wall time before the first start after a death, the second, ...; the last for ever.
_PAUSES_S: Final = (0.05, 0.5, 1.0, 2.0, 4.0, 5.0)

#: A process that ran this long had started well: its death is the first one again.
_STARTED_WELL_S: Final = 10.0

_MEANINGS: Final = {
    ExitCode.ENDED: "ended by itself",
    ExitCode.FAILED: "ended by a bug",
    ExitCode.BAD_SETTINGS: "cannot run with these settings",
    ExitCode.NOT_NOW: "lacks a part of the system",
    ExitCode.BAD_DATABASE: "cannot use its database",
}


@dataclass(slots=True)
class Restarts:
    """The deaths of one process in a row, and what was said about them."""

    _deaths: int = 0
    _said: tuple[str, float] = ("", 0.0)

    def pause_s(self, *, ran_s: float) -> float:
        """How long to wait now that the process has died after so many seconds."""
        if ran_s >= _STARTED_WELL_S:
            self._deaths, self._said = 0, ("", 0.0)
        pause_s = _PAUSES_S[min(self._deaths, len(_PAUSES_S) - 1)]
        self._deaths += 1
        return pause_s

    def is_news(self, cause: str, pause_s: float) -> bool:
        """Whether to say it: not again while the process keeps dying in the same way."""
        is_news = self._said != (cause, pause_s)
        self._said = (cause, pause_s)
        return is_news


def cause_of(exit_code: int) -> str:
    """Why a process ended, as a sentence without its subject."""
    if exit_code < 0:
        with suppress(ValueError):
            return f"was ended by {signal.Signals(-exit_code).name}"
    meaning = _MEANINGS.get(ExitCode(exit_code)) if exit_code in set(ExitCode) else None
    return f"{meaning or 'ended'} (exit code {exit_code})"


def is_for_good(exit_code: int) -> bool:
    """Whether the process would end again in the same way until a person does something."""
    return exit_code in FOR_GOOD
