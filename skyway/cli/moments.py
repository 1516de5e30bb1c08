"""The moments that options name: in fleet time, or counted from now."""

import re
from collections.abc import Callable
from datetime import datetime, timedelta
from functools import cache, partial
from typing import Final

from skyway.cli.data_folder import DataFolder
from skyway.cli.gateway import call_gateway, fail

#: A time from now: days, hours, minutes and seconds, each optional.
_FROM_NOW: Final = re.compile(
    r"\+(?=\d)(?:(\d{1,4})d)?(?:(\d{1,4})h)?(?:(\d{1,6})m)?(?:(\d{1,8})s)?"
)

#: Reads the moment of an option as RFC 3339; the second text is the option.
ReadMoment = Callable[[str, str], str]


def moment_reader(folder: DataFolder, *, key_name: str | None = None) -> ReadMoment:
    """A reader of moments; the gateway of the folder says what the fleet time is, if need be.

    The command ends with a message at a text that is not a moment.
    """
    return partial(_moment, now=cache(partial(_fleet_now, folder, key_name)))


def _moment(text: str, option: str, *, now: Callable[[], datetime]) -> str:
    """The moment in RFC 3339."""
    if (span := _FROM_NOW.fullmatch(text)) is not None:
        days, hours, minutes, seconds = (int(each or 0) for each in span.groups())
        later = timedelta(days=days, hours=hours, minutes=minutes, seconds=seconds)
        return (now() + later).isoformat()
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        fail(f"{option} {text}: not a moment; write 2026-03-02T14:00:00Z, or +2h30m from now")
    if moment.tzinfo is None:
        fail(f"{option} {text}: the time zone is missing; write {moment.isoformat()}Z for UTC")
    return moment.isoformat()


def _fleet_now(folder: DataFolder, key_name: str | None) -> datetime:
    clock = call_gateway("GET", "/v1/clock", key_name=key_name, folder=folder)
    return datetime.fromisoformat(clock["now"])
