"""The newest warnings and errors of a process: one entry for each kind, bounded, never raising."""

import logging
from collections.abc import Iterator

import pytest

from skyway.runtime.last_errors import MOST_KINDS, LastErrors
from skyway.runtime.tracing import trace_id_of, tracing


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
