"""Outages come as often and last as long as the scenario says, for the drones it names."""

from datetime import UTC, datetime, timedelta
from itertools import islice, takewhile

from skyway_drone_agent.simulated.disturbances import Disturbances, LinkLoss
from skyway_drone_agent.simulated.link_loss import Outage, has_outages, outages

from skyway.ids import DroneId

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
ME = DroneId("drn_1")
LOSSY = Disturbances(link=LinkLoss(share=0.5, every_s=600, for_s=30))


def in_ten_days(disturbed: Disturbances) -> list[Outage]:
    end = NOON + timedelta(days=10)
    found = outages(NOON, disturbed=disturbed, drone_id=ME)
    return list(takewhile(lambda outage: outage.from_at < end, found))


def test_outages_have_the_given_share_and_length() -> None:
    found = in_ten_days(LOSSY)

    assert 0.45 < len(found) / 1440 < 0.55
    assert all(one.until_at - one.from_at == timedelta(seconds=30) for one in found)
    assert len({int(one.from_at.timestamp() // 600) for one in found}) == len(found)


def test_a_restart_within_an_outage_finds_the_remaining_outage() -> None:
    first = next(outages(NOON, disturbed=LOSSY, drone_id=ME))

    midway = first.from_at + timedelta(seconds=10)

    assert next(outages(midway, disturbed=LOSSY, drone_id=ME)) == first


def test_drones_lose_their_links_at_different_moments() -> None:
    mine, other = (
        list(islice(outages(NOON, disturbed=LOSSY, drone_id=drone_id), 20))
        for drone_id in (ME, DroneId("drn_2"))
    )

    assert not set(mine) & set(other)


def test_only_drones_that_are_named_lose_their_link() -> None:
    named = Disturbances(link=LinkLoss(share=0.5, drone_ids=frozenset({ME})))

    assert has_outages(named, ME)
    assert not has_outages(named, DroneId("drn_2"))
    assert not has_outages(Disturbances(), ME)
