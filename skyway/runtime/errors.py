"""The runtime's branch of the tree of errors; `http/problems.py` maps each to its HTTP answer.

SkywayError
├── Unauthenticated         the caller is unknown
├── AccessDenied            the caller may not do this
│   ├── ScopeMissing        the caller's key does not have the scope that this needs
│   └── KeyNeeded           a browser's session may not do this, its key may
├── NotFound                also for things of other callers
├── Conflict                the present state forbids it; `code` names the reason
├── Misdirected             another server serves what was asked for
├── PreconditionFailed      If-Match named another version
├── TooLarge                a body above its limit
├── BudgetSpent             the caller used more than its budget; `code` names the budget
├── IdempotencyKeyReused    the same key came with another body
├── RowRefused              a unique, exclusion or trigger rule of the database refused a row
├── ServiceUnavailable      another service or the database does not answer now
│   ├── MqttUnavailable     the broker did not accept a message
│   └── DamagedDatabase     the database cannot be read until a person restores it
├── RemoteProblem           another service answered with a problem document
├── InvalidSettings         the environment of this process is incomplete or wrong
├── UnsafeDatabase          a database that would lose answered writes
└── UnknownRevision         a database with tables of another version of Skyway

An error that ends a process also has an `exit_code`, which `skyway up` reads.
"""

import os
import sys
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from enum import IntEnum
from typing import Any, Final

from skyway.errors import InvalidInput, SkywayError


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

#: Of several errors that end a process together, the code that stands last here wins.
_PERMANENCE: Final = tuple(map(ExitCode, (0, 3, 1, 2, 4)))


def exit_code_of(error: BaseException) -> ExitCode:
    """The code for an error, or a group of errors, that ends a process."""
    return _reason(error)[0]


def exit_code_after(program: str, run: Callable[[], int | None]) -> int:
    """What `run` returns, or the code of the error that ends it: the outermost frame of a process.

    The last line on standard error says why it ended. A bug leaves its traceback.
    """
    try:
        return run() or ExitCode.ENDED
    except (Exception, BaseExceptionGroup) as error:  # noqa: BLE001 - the outermost frame
        code, cause = _reason(error)
        said = str(cause) if isinstance(cause, SkywayError) else ""
        if isinstance(cause, OSError) and cause.filename is not None:
            said = f"{cause.filename}: {cause.strerror}"
        with suppress(OSError):  # the terminal may be lost
            if not said or isinstance(error, BaseExceptionGroup):
                traceback.print_exception(error)
            sys.stderr.write(f"{program}: {said or repr(cause)}\n")
        return code
    finally:
        try:
            sys.stderr.flush()
        except OSError:  # the terminal is lost: Python's own last flush must not fail
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


def _reason(error: BaseException) -> tuple[ExitCode, BaseException]:
    """The code, and the error that it stands for: of several errors the most permanent.

    An error that says nothing of its own has the code of its cause.
    """
    if isinstance(error, BaseExceptionGroup):
        found = [_reason(each) for each in error.exceptions]
    else:
        wrong_input = ExitCode.BAD_SETTINGS if isinstance(error, InvalidInput) else None
        own: ExitCode | None = getattr(error, "exit_code", wrong_input)
        found = [] if own is None else [(own, error)]
        if error.__cause__ is not None:
            found += [each for each in [_reason(error.__cause__)] if each[0] != ExitCode.FAILED]
    return max(found, key=lambda each: _PERMANENCE.index(each[0]), default=(ExitCode.FAILED, error))


class Unauthenticated(SkywayError):
    """The caller did not show who they are."""

    def __init__(self, detail: str = "a valid bearer is needed") -> None:
        super().__init__(detail)
        self.detail = detail


class AccessDenied(SkywayError):
    """The caller is known, but may not do this."""

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail


class ScopeMissing(AccessDenied):
    """The caller's role may do this, but the key that is shown may not; `scope` is needed."""

    def __init__(self, scope: str) -> None:
        super().__init__(f"this key does not have the scope {scope}")
        self.scope = scope


class KeyNeeded(AccessDenied):
    """A browser's session may not do this: what it gives would outlive the session."""

    def __init__(self) -> None:
        super().__init__(
            "this call gives a right that outlives a browser's session: show the API key itself "
            "(Authorization: Bearer sk_...)"
        )


class NotFound(SkywayError):
    """There is no such thing, or it belongs to another caller: both look the same on purpose."""

    def __init__(self, kind: str, identifier: str, *, advice: str = "") -> None:
        super().__init__(f"no {kind} {identifier!r}{advice and f': {advice}'}")
        self.kind = kind
        self.identifier = identifier


class Conflict(SkywayError):
    """The present state forbids what was asked.

    Parameters
    ----------
    code
        A stable UPPER_SNAKE reason, for programs: ``TOO_LATE``.
    detail
        The same for people, with the values in question.
    members
        Further members of the problem document, as JSON values.
    """

    def __init__(
        self,
        code: str,
        detail: str,
        *,
        members: Mapping[str, Any] | None = None,  # every code has members of its own
    ) -> None:
        super().__init__(f"{code}: {detail}")
        self.code = code
        self.detail = detail
        self.members = dict(members or {})


class Misdirected(SkywayError):
    """Another server serves what was asked for; the caller has to look where it is served now."""


class PreconditionFailed(SkywayError):
    """The caller has read another version than the present one."""

    def __init__(self, *, expected: str, present: str) -> None:
        super().__init__(f"version {expected} was expected, the present one is {present}")
        self.expected = expected
        self.present = present


class TooLarge(SkywayError):
    """A body is larger than its route accepts."""

    def __init__(self, limit_bytes: int) -> None:
        super().__init__(f"the body is larger than the limit of {limit_bytes} bytes")
        self.limit_bytes = limit_bytes


class BudgetSpent(SkywayError):
    """The caller has used its budget, and may try again later.

    Parameters
    ----------
    code
        The name of the budget, UPPER_SNAKE and stable.
    retry_after_s
        Seconds until the same call is within the budget.
    headers
        Fields for the HTTP answer that say what is left.
    """

    def __init__(
        self, code: str, retry_after_s: float, *, headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(f"the budget {code} is spent; try again in {retry_after_s:.1f} s")
        self.code = code
        self.retry_after_s = retry_after_s
        self.headers = dict(headers or {})


class IdempotencyKeyReused(SkywayError):
    """An Idempotency-Key came again, with another body."""

    def __init__(self) -> None:
        super().__init__("this Idempotency-Key was used before with another body")


class RowRefused(SkywayError):
    """A rule of the database refused a row: another row has what it claims.

    Parameters
    ----------
    constraint
        Name of the unique index, exclusion constraint or trigger rule, the same on SQLite and
        PostgreSQL when it was named.
    """

    def __init__(self, constraint: str) -> None:
        super().__init__(f"taken: {constraint}")
        self.constraint = constraint


class ServiceUnavailable(SkywayError):
    """Another service, or the database, does not answer now; asking later may help.

    `code` names the reason for programs, where there is one: ``OVERLOADED``.
    """

    exit_code = ExitCode.NOT_NOW

    def __init__(self, service: str, detail: str, *, code: str | None = None) -> None:
        super().__init__(f"{service} is unavailable: {detail}")
        self.service = service
        self.detail = detail
        self.code = code


class Overloaded(ServiceUnavailable):
    """More is asked than can be done soon; nothing was accepted.

    Parameters
    ----------
    wait_s, limit_s
        How long the request would wait, and the longest wait, wall seconds.
    """

    def __init__(self, wait_s: float, *, limit_s: float) -> None:
        detail = f"a request would wait {wait_s:.0f} s, longer than {limit_s:.0f} s"
        super().__init__("booking", detail, code="OVERLOADED")
        self.retry_after_s = wait_s - limit_s


class MqttUnavailable(ServiceUnavailable):
    """The broker is not connected, or did not acknowledge in time."""

    def __init__(self, detail: str) -> None:
        super().__init__("broker", detail)


class DamagedDatabase(ServiceUnavailable):
    """A database holds broken pages: it stays so until a person restores it."""

    exit_code = ExitCode.BAD_DATABASE

    def __init__(self, detail: str) -> None:
        super().__init__("database", f"it is damaged: {detail}")


class RemoteProblem(SkywayError):
    """Another service answered with an error.

    Parameters
    ----------
    status
        The HTTP status of the answer.
    problem
        Its problem document (RFC 9457); Any, since every problem has members of its own.
    """

    def __init__(self, status: int, problem: Mapping[str, Any]) -> None:
        title = problem.get("detail") or problem.get("title") or "no problem document"
        super().__init__(f"{status}: {title}")
        self.status = status
        self.problem = problem


class InvalidSettings(SkywayError):
    """Variables of the environment are missing or wrong; the message names each."""

    exit_code = ExitCode.BAD_SETTINGS


class UnsafeDatabase(SkywayError):
    """A database does not keep what it answered through a loss of power."""

    exit_code = ExitCode.BAD_SETTINGS


class UnknownRevision(SkywayError):
    """A newer version of Skyway has changed a database so that this version cannot use it."""

    exit_code = ExitCode.BAD_DATABASE

    def __init__(self, revision: str, *, newest: str) -> None:
        super().__init__(
            f"another version of Skyway has migrated the database: it stands at revision "
            f"{revision}, this version has {newest} and cannot use its tables. Start the newer "
            "version again, or restore the backup from before the upgrade"
        )
