"""Fits a trip into a gap: its drone must be ready for its next mission in time."""

from skyway.scheduling.slots import Slot, stay_to_begin_at
from skyway.scheduling.standby import shortened_trip
from skyway.scheduling.standby_choice import StandbyChoice
from skyway.scheduling.stays import stays_of_standby
from skyway.scheduling.trip import Trip


def standby_for(ready: Slot) -> StandbyChoice:
    """The standby of a drone that must be ready there: it flies there and charges."""
    return StandbyChoice("HOME", ready.station_id)


def fitted(trip: Trip, *, soc: float, ready: Slot) -> Trip | None:
    """The trip with its standby ended when the drone must be ready; None if it is not ready then.

    Parameters
    ----------
    trip
        A trip whose standby is that of `standby_for`.
    soc
        State of charge at its start, in [0, 1].
    ready
        Where, when and with what charge the drone must be ready.
    """
    stays = stays_of_standby(
        trip.plan,
        start_ms=trip.start_ms,
        soc=soc,
        home_plan=trip.home_plan,
        home_recharge=trip.home_recharge,
    )
    stay = stay_to_begin_at(stays, ready, not_left_before_ms=trip.start_ms)
    if stay is None:
        return None
    return shortened_trip(trip, ready.at_ms)
