"""How often the senders look at the outbox."""

from typing import Final

from skyway.runtime.pace import Pace

#: Seconds of wall time from one look at the table to the next: what is written and sent meanwhile
#: takes one statement, and a row that comes after a while of silence waits for nothing.
_SOON_S: Final = 0.05
#: The same under load, once more than a few looks were that soon: for what somebody waits for, and
#: for all else.
_QUICK_S: Final = 0.1
_UNHURRIED_S: Final = 0.2
_EARLY_LOOKS: Final = 10


def quick() -> Pace:
    """How often to look for what somebody waits for."""
    return Pace(_QUICK_S, burst=_EARLY_LOOKS, least_s=_SOON_S)


def unhurried() -> Pace:
    """How often to look for all else: seldom under load, quick when little is going on."""
    return Pace(_UNHURRIED_S, burst=_EARLY_LOOKS, least_s=_SOON_S)
