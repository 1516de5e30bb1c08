"""Tables put into a page of the docs."""

from skyway_lab.benchmarks.planner.page import filled

PAGE = "# Title\n\n<!-- table: one -->\nold\n<!-- end -->\n\n<!-- table: two -->\n<!-- end -->\n"


def test_a_table_replaces_what_stood_at_its_mark() -> None:
    page = filled(PAGE, {"one": "new"})

    assert page == PAGE.replace("old", "new")


def test_a_page_filled_twice_holds_a_table_once() -> None:
    page = filled(filled(PAGE, {"two": "table"}), {"two": "table"})

    assert page.count("table\n<!-- end -->") == 1
