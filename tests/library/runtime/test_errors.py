"""Errors carry data and show it in their message; those that end a process have an exit code."""

import asyncio

import pytest

from skyway.errors import InvalidInput, SkywayError
from skyway.runtime import errors
from skyway.runtime.errors import ExitCode, exit_code_after, exit_code_of


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (errors.NotFound("delivery", "dlv_1"), "no delivery 'dlv_1'"),
        (errors.Conflict("TOO_LATE", "it has left"), "TOO_LATE: it has left"),
        (errors.TooLarge(262144), "the body is larger than the limit of 262144 bytes"),
        (errors.RowRefused("pad_taken"), "taken: pad_taken"),
        (errors.MqttUnavailable("no PUBACK"), "broker is unavailable: no PUBACK"),
        (errors.RemoteProblem(422, {"title": "Bad"}), "422: Bad"),
        (
            errors.PreconditionFailed(expected="3", present="4"),
            "version 3 was expected, the present one is 4",
        ),
    ],
)
def test_a_message_names_the_values(error: SkywayError, message: str) -> None:
    assert str(error) == message


#: An error for each code, from the least permanent code to the most permanent.
ERRORS: dict[ExitCode, Exception] = {
    ExitCode.NOT_NOW: errors.ServiceUnavailable("database", "no connection"),
    ExitCode.FAILED: LookupError("a bug"),
    ExitCode.BAD_SETTINGS: errors.InvalidSettings("SKYWAY_PORT: is missing"),
    ExitCode.BAD_DATABASE: errors.DamagedDatabase("broken page"),
}


def caused_by(cause: Exception) -> Exception:
    """An error without a code of its own that another one caused."""
    error = RuntimeError("the loop ended")
    error.__cause__ = cause
    return error


def fail_in_a_task_group(error: Exception) -> int:
    async def fail() -> None:
        raise error

    async def run() -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(fail())

    asyncio.run(run())
    return 0


def test_every_exit_code_of_an_error_is_walked() -> None:
    assert {ExitCode.ENDED, *ERRORS} == set(ExitCode)


@pytest.mark.parametrize("code", ERRORS)
def test_an_exit_code_survives_groups_and_later_errors(code: ExitCode) -> None:
    error = ERRORS[code]
    nested = ExceptionGroup("outer", [ExceptionGroup("inner", [error])])

    found = [exit_code_of(each) for each in (error, nested, caused_by(error), caused_by(nested))]

    assert found == [code] * 4


@pytest.mark.parametrize("first", ERRORS)
@pytest.mark.parametrize("second", ERRORS)
def test_of_several_errors_the_most_permanent_one_wins(first: ExitCode, second: ExitCode) -> None:
    group = ExceptionGroup("both", [ERRORS[first], ERRORS[second]])

    worse = max(first, second, key=list(ERRORS).index)
    assert exit_code_of(group) == worse


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InvalidInput("fleet", "not JSON"), ExitCode.BAD_SETTINGS),
        (errors.UnsafeDatabase("no WAL"), ExitCode.BAD_SETTINGS),
        (errors.UnknownRevision("9", newest="8"), ExitCode.BAD_DATABASE),
        (errors.Conflict("TOO_LATE", "an answer to one caller"), ExitCode.FAILED),
    ],
)
def test_an_error_says_whether_a_restart_helps(error: SkywayError, code: ExitCode) -> None:
    assert exit_code_of(ExceptionGroup("tasks", [error])) == code


@pytest.mark.parametrize("code", ERRORS)
def test_a_process_ends_with_the_code_and_its_last_line_names_the_error(
    code: ExitCode, capsys: pytest.CaptureFixture[str]
) -> None:
    ended = exit_code_after("tower", lambda: fail_in_a_task_group(ERRORS[code]))

    last = capsys.readouterr().err.splitlines()[-1]
    assert ended == code
    assert last.startswith("tower: ")
    assert str(ERRORS[code]) in last
