"""The text Gantt: bars stand below the moments of the axis."""

from datetime import UTC, datetime, timedelta

from skyway.cli.gantt import Bar, Row, gantt_lines

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


def hours(number: float) -> datetime:
    return NOON + timedelta(hours=number)


def drawn(*rows: Row, columns: int = 60) -> list[str]:
    return gantt_lines(rows, start_at=NOON, end_at=hours(6), columns=columns)


def test_bars_stand_below_their_moments():
    axis, line = drawn(Row("drn_1", (Bar(hours(2), hours(4), "#"),)))

    assert axis == "      03-01 12:00         03-01 14:00         03-01 16:00"
    assert line == "drn_1 " + " " * 20 + "#" * 20


def test_a_later_bar_covers_an_earlier_one():
    _, line = drawn(Row("d", (Bar(NOON, hours(6), "."), Bar(hours(3), hours(6), "#"))))

    assert line == "d " + "." * 30 + "#" * 30


def test_a_short_bar_has_one_character():
    _, line = drawn(Row("d", (Bar(hours(6), hours(6), "#"),)))

    assert line == "d " + " " * 59 + "#"


def test_bars_outside_the_axis_are_left_out_and_others_are_cut():
    outside = Bar(hours(-3), hours(-2), "#")
    _, line = drawn(Row("d", (outside, Bar(hours(-1), hours(1), "="))))

    assert line == "d " + "=" * 10


def test_labels_are_aligned_and_notes_follow_the_bars():
    _, first, second = drawn(Row("a", ()), Row("long", (), "free"), columns=5)

    assert first == "a"
    assert second == "long" + " " * 7 + "free"
