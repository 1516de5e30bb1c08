"""One trace follows a request."""

import json
import logging
import subprocess
import sys
from collections.abc import Iterator

import pytest

from skyway.runtime.tracing import (
    MOST_KINDS,
    JsonLines,
    LastErrors,
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


@pytest.fixture
def errors() -> LastErrors:
    return LastErrors()


@pytest.fixture
def log(errors: LastErrors) -> Iterator[logging.Logger]:
    """A logger that writes to `errors` alone."""
    logger = logging.getLogger("skyway.test_last_errors")
    logger.propagate = False
    logger.addHandler(errors)
    yield logger
    logger.removeHandler(errors)


def test_one_kind_has_one_entry_with_its_newest_text(
    errors: LastErrors, log: logging.Logger
) -> None:
    log.info("all is well")
    for number in range(3):
        log.warning("place %s is lost", number)

    [entry] = errors.newest()
    assert (entry.level, entry.event, entry.times) == ("WARNING", "place 2 is lost", 3)


def test_an_entry_names_the_exception_and_the_trace(
    errors: LastErrors, log: logging.Logger
) -> None:
    with tracing(None) as traceparent:
        error = ConnectionError("no route " + "x" * 1_000)
        log.error("send failed", exc_info=error)

    [entry] = errors.newest()
    assert entry.reason is not None
    assert entry.reason.startswith("ConnectionError: no route xx")
    assert len(entry.reason) == 300
    assert entry.trace_id == trace_id_of(traceparent)


def test_the_kind_that_is_silent_longest_is_forgotten(
    errors: LastErrors, log: logging.Logger
) -> None:
    for number in range(MOST_KINDS):
        log.error(f"kind {number}")  # each text is a kind of its own
    log.error("kind 0")
    log.error("one more")

    events = [entry.event for entry in errors.newest()]
    assert events[:2] == ["one more", "kind 0"]
    assert len(events) == MOST_KINDS
    assert "kind 1" not in events


def test_a_text_whose_values_do_not_fit_stops_no_work(
    errors: LastErrors, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {"levelno": logging.ERROR, "msg": "needs %d", "args": ("a number",)}
    errors.handle(logging.makeLogRecord(values))

    assert errors.newest() == ()
    assert "needs" in capsys.readouterr().err
