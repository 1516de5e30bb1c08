"""Documents in which some values are replaced by values at the edges of their types."""

import json
import random

import pytest
from skyway_lab.benchmarks.hostile.extremes import extreme_text, with_extremes

DOCUMENT = {"at": "2026-03-01T00:00:00Z", "packages": [{"mass_kg": 1.5}], "is_held": False}


@pytest.mark.parametrize("seed", range(50))
def test_a_changed_document_differs_can_be_sent_and_leaves_the_original(seed: int) -> None:
    before = json.dumps(DOCUMENT)

    changed = with_extremes(DOCUMENT, random.Random(seed))

    assert json.dumps(changed)
    assert json.dumps(DOCUMENT) == before


def test_every_value_of_a_document_is_changed_at_some_time() -> None:
    chance = random.Random(1)
    changed = [with_extremes(DOCUMENT, chance, most=1) for _ in range(200)]

    objects = [each for each in changed if isinstance(each, dict)]
    assert any(each.get("at") != DOCUMENT["at"] for each in objects)
    assert any(each.get("is_held") is not False for each in objects)
    assert any(
        isinstance(each["packages"], list)
        and isinstance(each["packages"][0], dict)
        and each["packages"][0].get("mass_kg") != 1.5
        for each in objects
        if each.get("packages")
    )


def test_texts_for_paths_have_control_characters_and_markup() -> None:
    chance = random.Random(1)
    texts = {extreme_text(chance) for _ in range(500)}

    assert any("\x1b" in each for each in texts)
    assert any(each.startswith("[bold") for each in texts)
