"""Senders of messages that were set aside: slowed, put out, and read again."""

from datetime import UTC, datetime, timedelta

import pytest
from skyway_composition.quarantine import set_aside
from skyway_composition.quarantine.set_aside import PUT_OUT_FOR, Offenders

NOW = datetime(2026, 3, 1, 12, tzinfo=UTC)
SENDER, OTHER = ("prv_1", "drn_1"), ("prv_1", "drn_2")


def test_a_sender_is_slowed_and_then_put_out() -> None:
    known = Offenders()

    standings = [known.note(SENDER, 1.0, now=NOW) for _ in range(101)]

    assert standings == ["NORMAL"] * 10 + ["SLOWED"] * 90 + ["PUT_OUT"]
    assert known.is_put_out(SENDER, now=NOW)
    assert not known.is_put_out(OTHER, now=NOW)


def test_a_drone_with_one_faulty_message_in_each_state_is_never_slowed() -> None:
    known = Offenders()

    standings = {
        known.note(SENDER, 1.0, now=NOW + timedelta(seconds=30 * number)) for number in range(5_000)
    }

    assert standings == {"NORMAL"}


def test_a_sender_that_was_put_out_begins_anew_after_ten_minutes() -> None:
    known = Offenders()
    known.note(SENDER, 101.0, now=NOW)

    assert known.is_put_out(SENDER, now=NOW + PUT_OUT_FOR - timedelta(seconds=1))
    assert not known.is_put_out(SENDER, now=NOW + PUT_OUT_FOR)
    assert known.note(SENDER, 1.0, now=NOW + PUT_OUT_FOR) == "NORMAL"


def test_a_pardoned_sender_is_read_immediately() -> None:
    known = Offenders()
    known.note(SENDER, 101.0, now=NOW)

    known.pardon(SENDER)

    assert not known.is_put_out(SENDER, now=NOW)


def test_the_memory_of_senders_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(set_aside, "_MOST_SENDERS", 3)
    known = Offenders()
    known.note(SENDER, 50.0, now=NOW)

    for number in range(10):
        known.note(("prv_2", f"drn_{number}"), 1.0, now=NOW)

    assert known.note(SENDER, 1.0, now=NOW) == "NORMAL"
