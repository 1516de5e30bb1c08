"""One trace follows a request."""

import subprocess
import sys

import pytest

from skyway.runtime.tracing import (
    current_trace_id,
    current_traceparent,
    new_traceparent,
    trace_id_of,
    tracing,
)

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"
RECEIVED = f"00-{TRACE_ID}-00f067aa0ba902b7-01"


def test_a_received_trace_goes_on_and_ends_with_its_block() -> None:
    with tracing(RECEIVED) as traceparent:
        assert current_traceparent() == traceparent
        assert current_trace_id() == TRACE_ID
        assert traceparent != RECEIVED

    assert current_traceparent() is None
    assert current_trace_id() is None


def test_a_later_version_with_more_members_is_understood() -> None:
    assert trace_id_of(f"cc-{TRACE_ID}-00f067aa0ba902b7-01-what-else") == TRACE_ID


@pytest.mark.parametrize(
    "received",
    [
        None,
        "",
        RECEIVED.upper(),
        f"ff-{TRACE_ID}-00f067aa0ba902b7-01",
        f"00-{'0' * 32}-00f067aa0ba902b7-01",
        f"00-{TRACE_ID}-{'0' * 16}-01",
        f"{RECEIVED}-more",
        f"{RECEIVED}\n",
    ],
)
def test_an_invalid_traceparent_begins_a_new_trace(received: str | None) -> None:
    with tracing(received):
        assert current_trace_id() not in (None, TRACE_ID)


def test_new_traces_differ() -> None:
    assert trace_id_of(new_traceparent()) != trace_id_of(new_traceparent())


def test_the_drone_agent_can_import_it_without_the_web() -> None:
    code = "import sys, skyway.runtime.tracing; print('fastapi' in sys.modules)"

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stdout.strip() == "False"
