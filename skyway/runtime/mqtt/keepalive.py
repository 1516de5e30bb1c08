"""When a connection is to be looked at again, so that its pings are in time."""

from typing import Final

#: Looks in one keepalive while something is due: a ping, or the end of a connection that answers
#: none, is late by a fifth of it at most.
_LOOKS: Final = 5


def next_look_s(now_s: float, *, heard_s: float, said_s: float, keepalive_s: float) -> float:
    """When to look, by when something was last heard and said; all by the event loop's clock.

    Before a keepalive of silence has passed there is nothing to do. A fleet has a connection per
    drone, so most of its wake-ups would be these.
    """
    return max(min(heard_s, said_s) + keepalive_s, now_s + keepalive_s / _LOOKS)
