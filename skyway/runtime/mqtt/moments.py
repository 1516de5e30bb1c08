"""The moments of which a drone's message may speak now, by the fleet clock."""

from datetime import datetime
from typing import Final

from skyway.runtime.clock import FleetClock, fleet_margin

#: How far a message may be ahead of our clock, fleet and wall seconds. Our own choice.
_AHEAD_S: Final = (30.0, 5.0)

#: How far a state or a sample may be behind our clock, fleet and wall seconds: a week, and a day
#: where the fleet clock runs fast. Our own choice: they say what is so now, and no drone keeps them
#: for later. Events may be older, since a drone sends them when it is connected again.
_BEHIND_S: Final = (7 * 86_400.0, 86_400.0)


def latest_believed(clock: FleetClock) -> datetime:
    """The latest moment, fleet time, of which a message may speak now."""
    return clock.now() + fleet_margin(clock, fleet_s=_AHEAD_S[0], wall_s=_AHEAD_S[1])


def earliest_believed(clock: FleetClock) -> datetime:
    """The earliest moment, fleet time, of which a state or a sample may speak now."""
    return clock.now() - fleet_margin(clock, fleet_s=_BEHIND_S[0], wall_s=_BEHIND_S[1])
