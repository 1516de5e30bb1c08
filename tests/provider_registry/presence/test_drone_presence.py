"""The place and state of a drone, from its state or a later sample."""

from datetime import UTC, datetime, timedelta

import pytest
from skyway_provider_registry.fleets.drone import state_of
from skyway_provider_registry.presence.drone_presence import (
    NEVER_SEEN,
    SILENCE,
    Activity,
    ConnectionStatus,
    LastSample,
    LastState,
    Presence,
)

from skyway.geo import Position

AT = datetime(2026, 3, 1, tzinfo=UTC)
HERE, THERE = Position(0, 0), Position(1, 1)


def make_presence(
    *,
    activity: Activity | None = "IDLE",
    connection: ConnectionStatus | None = "ONLINE",
    sample: LastSample | None = None,
    **missions: str,
) -> Presence:
    state = None
    if activity is not None:
        state = LastState(
            session=7, at=AT, activity=activity, station_id=None, position=HERE, soc=0.9
        )
    return Presence(
        connection=connection,
        state=state,
        sample=sample,
        last_seen_at=AT,
        last_seen_wall_at=AT,
        **missions,  # type: ignore[arg-type]
    )


def make_sample(*, session: int = 7, later_s: float = 1) -> LastSample:
    at = AT + timedelta(seconds=later_s)
    return LastSample(session=session, at=at, position=THERE, soc=0.4)


@pytest.mark.parametrize("activity", ["FLYING", "RECHARGING"])
def test_a_later_sample_gives_the_place_of_a_moving_drone(activity: Activity) -> None:
    presence = make_presence(activity=activity, sample=make_sample())

    assert presence.place == (THERE, 0.4)


@pytest.mark.parametrize(
    ("activity", "sample"),
    [
        ("IDLE", make_sample()),
        ("FLYING", make_sample(later_s=-1)),
        ("FLYING", make_sample(session=6)),
        ("FLYING", None),
    ],
)
def test_an_older_sample_never_moves_a_drone_back(
    activity: Activity, sample: LastSample | None
) -> None:
    presence = make_presence(activity=activity, sample=sample)

    assert presence.place == (HERE, 0.9)


def test_a_drone_that_was_never_seen_has_no_place() -> None:
    assert NEVER_SEEN.place is None


@pytest.mark.parametrize(
    ("presence", "expected"),
    [
        (NEVER_SEEN, "REGISTERED"),
        (make_presence(activity=None), "REGISTERED"),
        (make_presence(), "AVAILABLE"),
        (make_presence(connection="LOST"), "OFFLINE"),
        (make_presence(connection="OFFLINE"), "OFFLINE"),
        (make_presence(activity="RECHARGING"), "RECHARGING"),
        (make_presence(mission_id="msn_1", mission_state="ACCEPTED"), "RESERVED"),
        (make_presence(mission_id="msn_1", mission_state="ACTIVE"), "ON_MISSION"),
        (make_presence(mission_id="msn_1"), "ON_MISSION"),
        (make_presence(mission_id="msn_1", connection="LOST"), "OFFLINE"),
    ],
)
def test_a_drone_is_in_one_state(presence: Presence, expected: str) -> None:
    assert state_of(presence, is_in_maintenance=False, wall_now=AT) == expected


@pytest.mark.parametrize("presence", [NEVER_SEEN, make_presence()])
def test_maintenance_comes_before_everything(presence: Presence) -> None:
    assert state_of(presence, is_in_maintenance=True, wall_now=AT) == "MAINTENANCE"


def test_a_silent_drone_counts_as_offline() -> None:
    presence = make_presence()

    at_the_limit = state_of(presence, is_in_maintenance=False, wall_now=AT + SILENCE)
    after = state_of(
        presence, is_in_maintenance=False, wall_now=AT + SILENCE + timedelta(seconds=1)
    )

    assert (at_the_limit, after) == ("AVAILABLE", "OFFLINE")
