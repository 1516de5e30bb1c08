"""One trace follows a request."""

import json
import logging
import subprocess
import sys

import pytest

from skyway.runtime.tracing import (
    JsonLines,
    configure_logs,
    current_trace_id,
    current_traceparent,
    in_trace_of,
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


def test_a_stored_trace_goes_on_under_another_span() -> None:
    with tracing(None), in_trace_of(RECEIVED):
        assert current_trace_id() == TRACE_ID
        assert current_traceparent() != RECEIVED


def test_within_the_stored_trace_the_span_stays() -> None:
    with tracing(RECEIVED) as traceparent, in_trace_of(RECEIVED):
        assert current_traceparent() == traceparent


def test_without_a_stored_trace_the_present_one_goes_on() -> None:
    with tracing(RECEIVED) as traceparent, in_trace_of(None):
        assert current_traceparent() == traceparent


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


def line(message: str, **extra: object) -> dict[str, object]:
    record = logging.makeLogRecord(
        {"name": "skyway.test", "levelno": logging.INFO, "levelname": "INFO", "msg": message}
    )
    vars(record).update(extra)
    return dict(json.loads(JsonLines("gateway").format(record)))


def test_a_record_is_one_object_with_its_extra_fields() -> None:
    written = line("plan composed", plan_id="pln_1", steps=7)

    assert written["event"] == "plan composed"
    assert (written["service"], written["level"]) == ("gateway", "INFO")
    assert (written["plan_id"], written["steps"]) == ("pln_1", 7)
    assert str(written["at"]).endswith("Z")


@pytest.mark.parametrize("name", ["password", "enrolment_token", "api_key", "authorization"])
def test_a_secret_is_not_written(name: str) -> None:
    assert line("made", **{name: "hunter2"})[name] == "***"


def test_a_value_without_a_json_form_is_written_as_text() -> None:
    assert line("made", what={1})["what"] == "{1}"


def test_a_record_names_the_trace_it_belongs_to() -> None:
    with tracing(None):
        written = line("made")

        assert written["trace_id"] == current_trace_id()


def test_an_exception_is_a_member() -> None:
    error = LookupError("lost")

    written = line("failed", exc_info=(type(error), error, None))

    assert "LookupError: lost" in str(written["exception"])


def test_requests_between_services_leave_no_line_each(
    capsys: pytest.CaptureFixture[str],
) -> None:
    root = logging.getLogger()
    before = root.level, root.handlers[:]
    try:
        configure_logs("gateway", "INFO")
        logging.getLogger("httpx").info("HTTP Request: GET http://registry 200")
        logging.getLogger("skyway").info("delivery planned")
    finally:
        root.setLevel(before[0])
        root.handlers[:] = before[1]
        logging.captureWarnings(capture=False)

    [written] = capsys.readouterr().err.splitlines()
    assert json.loads(written)["event"] == "delivery planned"
