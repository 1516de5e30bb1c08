"""The line below the events of a delivery says how far it is, and counts down."""

import io
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from rich.console import Console

from skyway.cli.progress_text import ProgressLine, progress_text

NOW = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


def delivery(*packages: tuple[int | None, int | None], **members: Any) -> dict[str, Any]:
    """A delivery in flight; ETA and delivery of its packages, each so many seconds from now."""

    def moment(second: int | None) -> str | None:
        return None if second is None else (NOW + timedelta(seconds=second)).isoformat()

    return {
        "state": "IN_PROGRESS",
        "activity": "FLYING",
        "packages": [
            {"package_id": f"p{n}", "eta_at": moment(eta), "delivered_at": moment(delivered)}
            for n, (eta, delivered) in enumerate(packages, 1)
        ],
        **members,
    }


@pytest.mark.parametrize(
    ("shown", "text"),
    [
        (delivery((720, None)), "flying, 0 of 1 delivered; p1 comes at 12:12:00, in 12 min"),
        (
            delivery((-60, -60), (900, None), (45, None)),
            "flying, 1 of 3 delivered; p3 comes at 12:00:45, in 45 s",
        ),
        (delivery((-1, None)), "flying, 0 of 1 delivered; p1 comes at 11:59:59, any moment now"),
        (delivery((-600, None)), "flying, 0 of 1 delivered; p1 comes at 11:50:00, 10 min overdue"),
        (delivery((None, None), state="REQUESTED", activity=None), "requested, 0 of 1 delivered"),
        (
            delivery((None, None), activity="OUT_OF_CONTACT"),
            "out of contact, 0 of 1 delivered",
        ),
    ],
)
def test_the_line_says_what_the_drone_does_and_what_comes_next(
    shown: dict[str, Any], text: str
) -> None:
    assert progress_text(shown, NOW) == text


def test_the_line_counts_down_without_another_answer_of_the_gateway() -> None:
    passed = timedelta(0)
    line = ProgressLine(lambda: NOW + passed)
    assert line.__rich__().plain == ""
    line.show(delivery((720, None)))
    assert line.__rich__().plain.endswith("in 12 min")

    passed = timedelta(minutes=5)

    assert line.__rich__().plain.endswith("in 7 min")


def test_a_terminal_shows_the_line() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=120)
    line = ProgressLine(lambda: NOW)
    line.show(delivery((720, None)))

    with console.capture() as captured:
        console.print(line)

    assert "p1 comes at 12:12:00" in captured.get()
