"""What is done about a drone's next QUEUED mission."""

from types import SimpleNamespace
from typing import Any

import pytest
from skyway_composition.missions.queue.plan_queue import (
    Decision,
    GiveUp,
    Leave,
    PlanAgain,
    Send,
    Shorten,
    Times,
    decide,
)

from skyway.delivery.qos import QoS
from skyway.ids import StationId
from skyway.scheduling.stays import Slot, Stay

B, HOME = StationId("b"), StationId("home")
NOW_MS = 10_000_000
TIMES = Times(
    now_ms=NOW_MS,
    reach_ms=5_000,
    plan_ms=30_000,
    hand_over_ms=30_000,
    send_ahead_ms=600_000,
    send_waiting_ms=120_000,
    longest_wait_ms=600_000,
)
#: The drone delivers at b in 100 s, and charges at home from 400 s to 1,400 s.
STAYS = (
    Stay(B, NOW_MS + 100_000, NOW_MS + 100_000, 0.5, 0.5),
    Stay(HOME, NOW_MS + 400_000, NOW_MS + 1_400_000, 0.4, 0.9),
    Stay(HOME, NOW_MS + 1_400_000, None, 0.9, 0.9),
)


def following(
    station_id: StationId = B,
    *,
    in_s: float,
    soc: float = 0.5,
    earliest_s: int = 0,
    wait_s: float = 0.0,
) -> Any:
    qos = QoS(pooling=True, pooling_wait_s=wait_s)
    return SimpleNamespace(
        request=SimpleNamespace(qos=qos),
        start=Slot(station_id, NOW_MS + round(in_s * 1000), soc),
        earliest_ms=NOW_MS + earliest_s * 1000 if earliest_s else 0,
    )


def live(*, state: str = "ACTIVE", stays: tuple[Stay, ...] = STAYS, proposal: object = None) -> Any:
    return SimpleNamespace(mission=SimpleNamespace(state=state), proposal=proposal, stays=stays)


def standing(
    station_id: StationId | None = B,
    *,
    soc: float = 0.5,
    is_occupied: bool = False,
    has_unread_events: bool = False,
    activity: str = "IDLE",
) -> Any:
    return SimpleNamespace(
        state=SimpleNamespace(station_id=station_id, soc=soc, activity=activity),
        is_occupied=is_occupied,
        has_unread_events=has_unread_events,
    )


def decided(
    mission: Any, *, before: Any = None, link: Any = None, is_in_this_world: bool = True
) -> Decision:
    return decide(
        mission,
        before=before,
        link=link,
        is_planned_in_this_world=is_in_this_world,
        times=TIMES,
    )


# Behind a live mission


def test_the_standby_ends_where_the_next_mission_begins() -> None:
    assert decided(following(in_s=130), before=live()) == Shorten(NOW_MS + 100_000)


def test_a_recharge_ends_a_hand_over_before_the_next_mission() -> None:
    mission = following(HOME, in_s=930, soc=0.6)

    assert decided(mission, before=live()) == Shorten(NOW_MS + 900_000)


def test_a_mission_at_the_last_stay_waits_until_the_mission_before_is_over() -> None:
    before = live(stays=STAYS[2:])

    assert decided(following(HOME, in_s=2_000, soc=0.9), before=before) == Leave()


def test_a_mission_behind_a_late_one_is_planned_from_the_first_stay() -> None:
    found = decided(following(in_s=60), before=live())

    assert found == PlanAgain(Slot(B, NOW_MS + 130_000, 0.5))


def test_a_mission_that_needs_more_charge_is_planned_again() -> None:
    assert isinstance(decided(following(in_s=130, soc=0.6), before=live()), PlanAgain)


def test_a_stay_that_the_drone_leaves_before_an_instruction_arrives_is_no_start() -> None:
    left = (Stay(B, NOW_MS - 1_000, NOW_MS + 4_000, 0.5, 0.5), *STAYS[1:])

    found = decided(following(in_s=33), before=live(stays=left))

    assert isinstance(found, PlanAgain)
    assert (found.slot.station_id, found.slot.at_ms) == (HOME, NOW_MS + 430_000)


def test_a_mission_that_was_planned_before_a_closure_is_planned_again() -> None:
    found = decided(following(in_s=130), before=live(), is_in_this_world=False)

    assert found == PlanAgain(Slot(B, NOW_MS + 130_000, 0.5))


@pytest.mark.parametrize("before", [live(state="BOOKED"), live(proposal=object()), live(stays=())])
def test_nothing_is_done_while_the_plan_before_is_in_question(before: Any) -> None:
    assert decided(following(in_s=60), before=before, is_in_this_world=False) == Leave()


@pytest.mark.parametrize(("in_s", "decision"), [(-600, Leave), (-601, GiveUp)])
def test_a_mission_waits_ten_minutes_for_a_plan_that_is_in_question(
    in_s: int, decision: type[Decision]
) -> None:
    assert isinstance(decided(following(in_s=in_s), before=live(stays=())), decision)


# The drone has no mission


@pytest.mark.parametrize(("in_s", "decision"), [(5, Send), (90, Send), (4, PlanAgain)])
def test_a_mission_is_sent_if_its_drone_still_gets_it_in_time(
    in_s: int, decision: type[Decision]
) -> None:
    assert isinstance(decided(following(in_s=in_s), link=standing()), decision)


@pytest.mark.parametrize(("wait_s", "decision"), [(0, Send), (900, Leave)])
def test_a_mission_that_waits_for_others_is_sent_later(
    wait_s: float, decision: type[Decision]
) -> None:
    waiting = following(in_s=130, earliest_s=130, wait_s=wait_s)
    assert isinstance(decided(waiting, link=standing()), decision)


def test_a_mission_that_can_begin_a_minute_sooner_is_planned_again() -> None:
    assert decided(following(in_s=91), link=standing()) == PlanAgain(Slot(B, NOW_MS + 30_000, 0.5))


def test_a_mission_does_not_begin_sooner_than_its_customer_allows() -> None:
    assert decided(following(in_s=600, earliest_s=580), link=standing()) == Send()


def test_a_mission_that_begins_much_later_is_not_sent_yet() -> None:
    assert decided(following(in_s=601, earliest_s=600), link=standing()) == Leave()


@pytest.mark.parametrize("link", [standing(HOME), standing(soc=0.49)])
def test_a_mission_is_planned_again_from_another_place_or_less_charge(link: Any) -> None:
    assert isinstance(decided(following(in_s=60), link=link), PlanAgain)


def test_a_charge_that_differs_as_sensors_do_is_the_same() -> None:
    assert decided(following(in_s=60), link=standing(soc=0.4951)) == Send()


def test_a_free_drone_after_a_closure_gets_a_new_plan() -> None:
    found = decided(following(in_s=60), link=standing(), is_in_this_world=False)

    assert isinstance(found, PlanAgain)


_UNKNOWN = [
    None,
    SimpleNamespace(state=None, is_occupied=False, has_unread_events=False),
    standing(is_occupied=True),
    standing(has_unread_events=True),
    standing(None),
    standing(None, activity="DOWN", has_unread_events=True),
]


@pytest.mark.parametrize("link", _UNKNOWN)
def test_nothing_is_sent_to_a_drone_whose_place_is_not_known(link: Any) -> None:
    assert decided(following(in_s=60), link=link) == Leave()


@pytest.mark.parametrize("link", _UNKNOWN)
def test_a_mission_is_given_up_if_its_drone_is_not_free_for_long(link: Any) -> None:
    assert isinstance(decided(following(in_s=-601), link=link), GiveUp)


def test_a_mission_of_a_drone_that_landed_in_the_open_is_given_up_immediately() -> None:
    link = standing(None, activity="DOWN", is_occupied=True)

    assert isinstance(decided(following(in_s=3_600), link=link), GiveUp)
