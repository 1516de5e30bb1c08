"""When a failed notification is tried again, and when it is given up."""

import random
from typing import Final

_MINUTE_S: Final = 60.0
_HOUR_S: Final = 3600.0

#: Seconds of wall time between two attempts; after the last attempt the notification is given up.
_PAUSES_S: Final = (
    5.0,
    30.0,
    2 * _MINUTE_S,
    15 * _MINUTE_S,
    _HOUR_S,
    3 * _HOUR_S,
    6 * _HOUR_S,
    12 * _HOUR_S,
    24 * _HOUR_S,
)

#: Pauses vary by this share, so that notifications that failed together are not repeated together.
_JITTER: Final = 0.2

#: The longest pause, seconds of wall time.
LONGEST_PAUSE_S: Final = max(_PAUSES_S) * (1 + _JITTER)

#: All attempts of one notification.
MOST_ATTEMPTS: Final = len(_PAUSES_S) + 1


def pause_s(attempts: int, chance: random.Random) -> float | None:
    """Seconds until the next attempt after so many failed ones; None when there is none."""
    if attempts >= MOST_ATTEMPTS:
        return None
    return _PAUSES_S[attempts - 1] * chance.uniform(1 - _JITTER, 1 + _JITTER)
