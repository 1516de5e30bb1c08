"""Slots of webhooks: nobody's silent receivers delay anybody else."""

import pytest
from skyway_gateway.notifications.fair_slots import FairSlots, SlotLimits
from skyway_gateway.notifications.webhook import Endpoint

from skyway.ids import SubjectId, WebhookId

LIMITS = SlotLimits(all=16, per_customer=4)  # 2 of one destination, 6 silent


def endpoint(number: int, *, customer: str = "mallory", host: str | None = None) -> Endpoint:
    url = f"http://{host or f'h{number}'}.example/"
    return Endpoint(WebhookId(f"whk_{customer}_{number}"), SubjectId(customer), url, ("secret",))


@pytest.fixture
def slots() -> FairSlots:
    return FairSlots(LIMITS)


def test_one_customer_has_a_part_of_the_slots(slots: FairSlots) -> None:
    hanging = [endpoint(number) for number in range(1_200)]
    honest = endpoint(1, customer="alice")

    chosen = slots.choose([*hanging, honest])

    assert len(chosen) == 5
    assert honest in chosen


def test_one_destination_has_a_part_of_the_slots_of_several_customers(slots: FairSlots) -> None:
    same = [endpoint(n, customer=f"c{n}", host="same") for n in range(10)]

    assert len(slots.choose(same)) == 2


def test_a_customer_leaves_slots_at_a_destination_that_others_use(slots: FairSlots) -> None:
    hanging = [endpoint(n, host="same") for n in range(10)]
    honest = endpoint(1, customer="alice", host="same")

    assert slots.choose([*hanging, honest]) == [hanging[0], honest]


def test_silent_endpoints_of_many_customers_leave_slots_at_their_destination() -> None:
    slots = FairSlots(SlotLimits(all=64, per_customer=8))  # 4 of one destination
    hanging = [endpoint(n, customer=f"m{n}", host="same") for n in range(10)]
    for each in hanging:
        slots.note_reply(each.webhook_id, is_answer=False)

    assert len(slots.choose(hanging)) == 2
    honest = [endpoint(n, customer=f"c{n}", host="same") for n in range(10)]
    assert len(slots.choose(honest)) == 2


def test_silent_endpoints_of_many_customers_leave_slots_for_others(slots: FairSlots) -> None:
    hanging = [endpoint(n, customer=f"m{n // 4}") for n in range(100)]
    for each in hanging:
        slots.note_reply(each.webhook_id, is_answer=False)

    assert len(slots.choose(hanging)) == 6
    honest = [endpoint(n, customer=f"c{n}") for n in range(20)]
    assert len(slots.choose(honest)) == 10


def test_an_endpoint_that_answers_again_is_like_any_other(slots: FairSlots) -> None:
    back = [endpoint(n, customer=f"c{n}") for n in range(16)]
    for each in back:
        slots.note_reply(each.webhook_id, is_answer=False)
        slots.note_reply(each.webhook_id, is_answer=True)

    assert len(slots.choose(back)) == 16


def test_an_endpoint_is_served_once_at_a_time_and_again_after_its_release(
    slots: FairSlots,
) -> None:
    one = endpoint(1)

    assert slots.choose([one]) == [one]
    assert slots.choose([one]) == []
    slots.release(one)
    assert slots.choose([one]) == [one]


def test_the_endpoint_that_was_served_longest_ago_comes_first(slots: FairSlots) -> None:
    own = [endpoint(number) for number in range(10)]
    seen: list[Endpoint] = []
    for _ in range(5):
        chosen = slots.choose(own)
        seen += chosen
        for each in chosen:
            slots.release(each)

    assert {each.webhook_id for each in seen[:10]} == {each.webhook_id for each in own}


def test_the_memory_is_bounded_and_free_slots_are_all_free() -> None:
    slots = FairSlots(LIMITS, most_remembered=5)
    for number in range(100):
        one = endpoint(number)
        slots.choose([one])
        slots.note_reply(one.webhook_id, is_answer=False)
        slots.release(one)

    assert len(slots._silent) == len(slots._chosen) == 5
    assert not slots._used
    assert not slots._served
