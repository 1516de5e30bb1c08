"""A drone that is offline."""

from typing import Any

import pytest

pytestmark = [pytest.mark.end_to_end, pytest.mark.long]


@pytest.mark.storage_pair("embedded")
def test_an_online_drone_is_preferred_to_an_offline_drone(system: Any) -> None:
    system.publish_corridor("away")
    away = system.start_fleet(["away-s1"], name="Away Air")
    system.fleets[-1].kill()
    system.fleets[-1].wait()
    there = system.start_fleet(["away-s2"], name="There Air")

    delivery_id = system.request_delivery(["away-s3"], pickup="away-s1")

    delivery = system.until_state(delivery_id, "COMPLETED")
    assert delivery["missions"][-1]["provider_id"] == there["provider_id"]
    assert away["provider_id"] != there["provider_id"]
