"""The page of the reference is written from the file of runs."""

from skyway_lab.benchmarks.chaos.page import PAGE, FinishedRun, page_with, read_runs
from skyway_lab.benchmarks.chaos.recovery import Recovery

RUN = FinishedRun(
    storage="embedded",
    seed=7,
    minutes=10.0,
    clock_rate=600.0,
    machine="a machine",
    requests=400,
    faults=1,
    flaws=0,
    recoveries=(Recovery("kill: gateway", 1.0, 2.0, 3.5),),
)


def test_a_run_is_the_same_after_it_is_written_and_read() -> None:
    assert FinishedRun.read(RUN.as_line()) == RUN


def test_a_run_is_in_the_tables_of_its_pair() -> None:
    page = "<!-- table: embedded -->\n<!-- end -->\n<!-- table: production -->\n<!-- end -->\n"

    embedded, production, _ = page_with(page, [RUN]).split("<!-- end -->")

    assert "| kill: gateway | 1     | 1.0 / 1.0        | 2.0 / 2.0 | 3.5 / 3.5  |" in embedded
    assert "kill: gateway" not in production


def test_the_page_shows_the_runs_of_the_file_and_all_kinds_of_faults() -> None:
    assert PAGE.read_text() == page_with(PAGE.read_text(), read_runs())
