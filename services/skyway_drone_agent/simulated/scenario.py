"""Scenarios: files that say what goes otherwise than planned; some come with Skyway."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from skyway.errors import InvalidInput
from skyway_drone_agent.simulated.disturbances import Disturbances

_BUNDLED: Final = Path(__file__).parent / "scenarios"


def scenario_names() -> tuple[str, ...]:
    """The scenarios that come with Skyway."""
    return tuple(sorted(path.stem for path in _BUNDLED.glob("*.toml")))


def read_scenario(name_or_file: str) -> Disturbances:
    """The disturbances of a bundled scenario, by its name, or of a file of one's own.

    Raises
    ------
    InvalidInput
        There is no such scenario, or the file breaks a limit: key, value and limit are named.
    """
    is_bundled = name_or_file in scenario_names()
    path = _BUNDLED / f"{name_or_file}.toml" if is_bundled else Path(name_or_file)
    try:
        content = tomllib.loads(path.read_text())
    except FileNotFoundError as error:
        known = ", ".join(scenario_names())
        raise InvalidInput("scenario", f"{name_or_file} is no file, nor one of {known}") from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InvalidInput("scenario", f"{path} cannot be read: {error}") from error
    return _checked(content, source=f"{path.name}: ")


def changed(scenario: Disturbances, changes: Mapping[str, Any]) -> Disturbances:
    """The scenario with other values of some keys, whose limits are checked as those of a file."""
    return _checked(scenario.model_dump(exclude_unset=True) | dict(changes), source="")


def _checked(content: Mapping[str, Any], *, source: str) -> Disturbances:  # values as TOML has them
    try:
        return Disturbances.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"]) or "scenario"
        if first["type"] == "extra_forbidden":
            detail = "there is no such key"
        else:
            detail = f"{first['msg']}, not {first['input']!r}"
        raise InvalidInput(f"{source}{key}", detail) from error
