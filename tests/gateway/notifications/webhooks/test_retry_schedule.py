"""When a failed notification is tried again."""

import random

from skyway_gateway.notifications.webhooks.retry_schedule import MOST_ATTEMPTS, pause_s


def test_pauses_grow_and_end() -> None:
    chance = random.Random(1)
    pauses = [pause_s(attempts, chance) for attempts in range(1, MOST_ATTEMPTS + 2)]
    assert pauses[-2:] == [None, None]
    given = [pause for pause in pauses if pause is not None]
    assert len(given) == MOST_ATTEMPTS - 1
    assert given == sorted(given)
    assert 4 <= given[0] <= 6
    assert sum(given) > 24 * 3600


def test_pauses_vary_between_notifications() -> None:
    chance = random.Random(1)
    assert len({pause_s(3, chance) for _ in range(20)}) == 20
