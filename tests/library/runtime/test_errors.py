"""Errors carry data and show it in their message."""

import pytest

from skyway.errors import SkywayError
from skyway.runtime import errors


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
