"""With which code a process ends; `skyway up` decides by it whether to start the process again."""

from enum import IntEnum
from typing import Final

from skyway.runtime.errors import DamagedDatabase, ServiceUnavailable, UnknownRevision


class ExitCode(IntEnum):
    """docs/reference/operations.md says what each code means."""

    ENDED = 0
    #: A bug. Python itself ends with it after an error that nothing caught.
    FAILED = 1
    #: The environment is incomplete or wrong.
    BAD_SETTINGS = 2
    #: A part that the process needs is away, such as its port or the database.
    NOT_NOW = 3
    #: The database is damaged, or of another version of Skyway.
    BAD_DATABASE = 4


#: The same process would end again with the same code until a person has done something.
FOR_GOOD: Final = frozenset({ExitCode.BAD_SETTINGS, ExitCode.BAD_DATABASE})


def exit_code_of(error: Exception) -> ExitCode:
    """The code for an error that ends a process."""
    if isinstance(error, DamagedDatabase | UnknownRevision):
        return ExitCode.BAD_DATABASE
    if isinstance(error, ServiceUnavailable):
        return ExitCode.NOT_NOW
    return ExitCode.BAD_SETTINGS
