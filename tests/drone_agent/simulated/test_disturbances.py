"""Scenario files are read whole or refused with the key and its limit; the docs name every key."""

import re
from pathlib import Path

import pytest
from pydantic import BaseModel
from skyway_drone_agent.simulated.disturbances import Disturbances, read_scenario, scenario_names

from skyway.errors import InvalidInput

DOCS = Path(__file__).parents[3] / "docs" / "scenarios.md"


def file_of(folder: Path, content: str) -> str:
    path = folder / "own.toml"
    path.write_text(content)
    return str(path)


@pytest.mark.parametrize("name", scenario_names())
def test_each_bundled_scenario_is_valid_and_documented(name: str) -> None:
    assert read_scenario(name).title
    assert f"`{name}`" in DOCS.read_text()


def test_an_empty_scenario_disturbs_nothing() -> None:
    assert read_scenario("calm").model_copy(update={"title": ""}) == Disturbances()


def test_a_scenario_file_is_read(tmp_path: Path) -> None:
    own = file_of(
        tmp_path,
        """
        seed = 3
        absent_station_ids = ["a", "b"]
        [wind]
        mean_mps = 4
        [[pads.taken]]
        station_id = "a"
        from_at = 2026-03-01T12:00:00Z
        until_at = 2026-03-01T13:00:00Z
        """,
    )

    scenario = read_scenario(own)

    assert (scenario.seed, scenario.wind.mean_mps) == (3, 4.0)
    assert scenario.absent_station_ids == {"a", "b"}
    assert scenario.pads.taken[0].pad is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[wind]\nmean_mps = 50", "own.toml: wind.mean_mps: must be at most 40, not 50"),
        ("[wind]\nmean = 5", "own.toml: wind.mean: is not a known field"),
        ("power_noise = 'much'", "own.toml: power_noise: must be a number.*, not 'much'"),
        ("[link]\nshare = 0.1\nevery_s = 10", "own.toml: link: .*for_s 30 is not below every_s 10"),
        (
            "pads = {taken = [{station_id = 'a', from_at = 2026-03-01, until_at = 2026-03-01}]}",
            "own.toml: pads.taken.0.from_at: must be a moment",
        ),
        ("[wind", "scenario: .*own.toml cannot be read"),
    ],
)
def test_a_wrong_file_is_refused_by_key_and_limit(
    tmp_path: Path, content: str, message: str
) -> None:
    with pytest.raises(InvalidInput, match=re.compile(message, re.DOTALL)):
        read_scenario(file_of(tmp_path, content))


def test_an_unknown_scenario_name_is_answered_with_the_bundled_names() -> None:
    with pytest.raises(
        InvalidInput, match=r"wibdy is neither a file nor one of busy, calm, .*windy"
    ):
        read_scenario("wibdy")


def test_the_docs_name_every_key_and_no_other() -> None:
    documented = set(re.findall(r"^\| `([a-z_.]+)` \|", DOCS.read_text(), re.MULTILINE))
    documented -= set(scenario_names())

    assert documented == set(keys_of(Disturbances))


def keys_of(model: type[BaseModel], prefix: str = "") -> list[str]:
    """All keys of a scenario file, with those of its sections behind a dot."""
    keys: list[str] = []
    for name, field in model.model_fields.items():
        section = field.annotation
        if isinstance(section, type) and issubclass(section, BaseModel):
            keys += keys_of(section, f"{prefix}{name}.")
        elif (prefix, name) == ("pads.", "taken"):
            keys += [f"pads.taken.{key}" for key in ("station_id", "pad", "from_at", "until_at")]
        else:
            keys.append(prefix + name)
    return keys
