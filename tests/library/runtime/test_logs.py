"""Logs are JSON lines, with ids as members and without secrets."""

import json
import logging

import pytest

from skyway.runtime.logs import JsonLines, configure_logs
from skyway.runtime.tracing import current_trace_id, tracing


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
