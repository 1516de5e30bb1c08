from skyway.experiments.page import write_fragment, write_page
from skyway.experiments.section import Finding, Section


def test_running_one_part_again_keeps_the_others_on_the_page(laboratory):
    for name, text in (("paper", "first"), ("scale", "other"), ("paper", "second")):
        section = Section(name, [text], [Finding("is it there", "yes")])
        write_fragment(laboratory, name, section, elapsed_s=1.0)

    page = write_page(laboratory.folder).read_text(encoding="utf-8")

    assert "second" in page
    assert "first" not in page
    assert page.index("## paper") < page.index("## scale")
    assert "- is it there: yes" in page
