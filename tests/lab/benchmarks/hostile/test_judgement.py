"""What counts as harm that rogues have done."""

from skyway_lab.benchmarks.hostile.judgement import flaws_of
from skyway_lab.benchmarks.hostile.rogues import Answers


def kinds(
    answers: Answers | None = None,
    *,
    calm: dict[str, list[float]] | None = None,
    attacked: dict[str, list[float]] | None = None,
    growth_mib: dict[str, float] | None = None,
) -> list[str]:
    found = flaws_of(
        answers or Answers(),
        calm=calm or {},
        attacked=attacked or {},
        growth_mib=growth_mib or {},
    )
    return [each.kind for each in found]


def test_nothing_is_wrong_when_nothing_was_harmed() -> None:
    assert kinds(calm={"quote": [1.0]}, attacked={"quote": [1.9]}, growth_mib={"gateway": 9}) == []


def test_a_call_that_breaks_a_server_is_a_flaw_and_many_are_counted() -> None:
    assert kinds(Answers(broken=["500"])) == ["broken call"]
    assert len(kinds(Answers(broken=["500"] * 50))) == 21


def test_work_that_takes_more_than_twice_as_long_is_a_flaw_unless_it_is_still_short() -> None:
    assert kinds(calm={"quote": [1.0]}, attacked={"quote": [2.1]}) == ["slower"]
    assert kinds(calm={"quote": [0.01]}, attacked={"quote": [0.2]}) == []


def test_work_that_is_not_done_at_all_is_a_flaw() -> None:
    assert kinds(calm={"quote": [1.0]}, attacked={}) == ["stopped"]


def test_a_process_that_grows_much_is_a_flaw() -> None:
    assert kinds(growth_mib={"gateway": 500.0}) == ["memory"]
