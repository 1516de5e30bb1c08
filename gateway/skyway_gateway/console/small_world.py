"""The small world that `skyway up` starts when an operator asks for it in the console."""

from dataclasses import dataclass
from pathlib import Path

from skyway.contracts.figures import SmallWorldState
from skyway.runtime.errors import Conflict


@dataclass(frozen=True, slots=True)
class SmallWorld:
    """A file that `skyway up` waits for; None where the gateway was started in another way."""

    request_file: Path | None

    @property
    def state(self) -> SmallWorldState:
        """Whether there can be one, and whether somebody has asked for it."""
        if self.request_file is None:
            return "UNAVAILABLE"
        return "REQUESTED" if self.request_file.exists() else "AVAILABLE"

    def request(self) -> None:
        """Ask for it; a second request changes nothing.

        Raises
        ------
        Conflict
            NO_SMALL_WORLD: the gateway was not started by `skyway up`.
        """
        if self.request_file is None:
            raise Conflict("NO_SMALL_WORLD", "only skyway up starts a small world")
        self.request_file.touch()
