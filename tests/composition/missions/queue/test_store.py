"""The statements of calendars read only missions that are not over."""

import re

from skyway_composition.missions.queue.store import TO_LOOK_AT


def test_the_search_for_drones_names_the_states_of_missions_literally() -> None:
    """With a parameter PostgreSQL takes no partial index, and reads all past missions."""
    statement = str(TO_LOOK_AT)

    assert re.findall(r"state = :\w+|state IN \(:\w+", statement) == []
    assert "queued.state = 'QUEUED'" in statement
