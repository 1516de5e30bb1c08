import csv

import pytest
from skyway_lab.experiments.laboratory import Laboratory
from skyway_lab.experiments.page import PARTS, write_fragment, write_page
from skyway_lab.experiments.report import Section, SummaryLine, image

from tests.long_cases import sampled

#: Parts that simulate fleets, each run twice with the same seed.
REPEATED = ("booked-fleet", "causes", "dispatch", "fleet")
ONCE = [name for name in PARTS if name not in ("paper", *REPEATED)]


def run_part(laboratory: Laboratory, name: str) -> str:
    """Run a part and check what it has written; its rows as text."""
    section = PARTS[name](laboratory)

    written = (laboratory.folder / f"{name}.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(written.splitlines()))
    shown = [text.split("](")[1][:-1] for text in section.paragraphs if text[:2] == "!["]
    assert section.findings
    assert rows
    assert all((laboratory.folder / figure).stat().st_size > 1_000 for figure in shown)
    return written


@pytest.mark.parametrize("name", sampled(ONCE, every=5))
def test_every_part_writes_findings_rows_and_its_figures(laboratory: Laboratory, name: str) -> None:
    run_part(laboratory, name)


@pytest.mark.parametrize("name", REPEATED)
@pytest.mark.long
def test_the_same_seed_gives_the_same_rows(laboratory: Laboratory, name: str) -> None:
    first, second = run_part(laboratory, name), run_part(laboratory, name)

    assert first == second


def test_running_one_part_again_keeps_the_others_on_the_page(laboratory):
    for name, text in (("paper", "first"), ("scale", "other"), ("paper", "second")):
        section = Section(name, [text], [SummaryLine("is it there", "yes")])
        write_fragment(laboratory, name, section, elapsed_s=1.0)

    page = write_page(laboratory.folder).read_text(encoding="utf-8")

    assert "second" in page
    assert "first" not in page
    assert page.index("## paper") < page.index("## scale")
    assert "- is it there: yes" in page


def test_a_fragment_and_the_page_both_link_to_the_figure(laboratory: Laboratory) -> None:
    section = Section("paper", [image("paper.png", "time")])
    write_fragment(laboratory, "paper", section, elapsed_s=1.0)

    page = write_page(laboratory.folder)

    fragment = (laboratory.folder / "paper.md").read_text(encoding="utf-8")
    assert "![time](paper.png)" in fragment
    assert f"![time]({laboratory.folder.name}/paper.png)" in page.read_text(encoding="utf-8")
