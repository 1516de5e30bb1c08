"""Every state of the API has a name and a sentence in the console."""

import json
from pathlib import Path
from typing import Any, Final

import pytest

from tests.end_to_end.browser import needs_browser
from tests.gateway.console.staged_page import StagedPage

pytestmark = [pytest.mark.integration, needs_browser]

#: By kind of the console's words: the schema of the API, and its member.
_KINDS: Final = {
    "delivery": ("Delivery", "state"),
    "deliveryActivity": ("Delivery", "activity"),
    "package": ("PackageStatus", "state"),
    "drone": ("Drone", "state"),
    "droneActivity": ("Drone", "activity"),
    "mission": ("Mission", "state"),
    "alarmLevel": ("Alarm", "level"),
    "alarm": ("Alarm", "state"),
}


def states_of(schema: str, member: str) -> list[str]:
    """The values that a member of an answer may have."""
    document = json.loads((Path(__file__).parents[3] / "openapi/gateway.json").read_text())
    found: dict[str, Any] = document["components"]["schemas"][schema]["properties"][member]
    given = next((each for each in found.get("anyOf", ()) if "enum" in each), found)
    states: list[str] = given["enum"]
    return states


def test_every_state_has_a_name_and_a_sentence(stage: StagedPage) -> None:
    page = stage.open("/console#/alarms").page
    words = page.evaluate(
        """async (kinds) => {
          const {statesOf, stateName, stateHint} = await import("/console/state_words.js");
          return Object.fromEntries(kinds.map((kind) => [kind, statesOf(kind).map((state) =>
            [state, stateName(kind, state), stateHint(kind, state)])]));
        }""",
        list(_KINDS),
    )

    for kind, (schema, member) in _KINDS.items():
        assert sorted(state for state, _, _ in words[kind]) == sorted(states_of(schema, member))
        for state, name, hint in words[kind]:
            assert name, state
            assert hint.endswith("."), state
