"""From when on a drone can be booked again, under each policy."""

from skyway_lab.experiments.fleet_hour.calendars import POLICIES

from skyway.ids import StationId
from skyway.scheduling.stays import Stay

B, C, HOME = (StationId(name) for name in ("b", "c", "home"))
#: The drone delivers at b, lands at c on its way, and charges at home.
STAYS = (
    Stay(B, 100, 100, 0.5, 0.5),
    Stay(C, 150, 180, 0.3, 0.6),
    Stay(HOME, 200, 400, 0.3, 0.9),
    Stay(HOME, 400, None, 0.9, 0.9),
)


def test_a_policy_says_at_which_stays_a_drone_can_be_booked_again() -> None:
    free_ms = {policy.name: policy.usable(STAYS)[0].from_ms for policy in POLICIES}

    assert free_ms == {
        "one at a time": 400,
        "free while charging": 200,
        "stay": 100,
        "chained, home": 100,
        "chained": 100,
    }
