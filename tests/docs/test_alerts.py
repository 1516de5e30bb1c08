"""The alert rules and the board ask for metrics that exist, and each alert is explained."""

import re

from tests.metric_names import BOARD, ROOT, Labels, alert_rules, expressions, faults_of
from tools.write_board import board_text

PAGE = (ROOT / "docs/reference/alerts.md").read_text()
METRICS = (ROOT / "docs/reference/metrics.md").read_text()

#: A row of the page of metrics: names, services, labels.
_ROW = re.compile(r"^\| (`skyway_[^|]+) \|[^|]*\|([^|]*)\|", re.MULTILINE)

#: A label in the third column of such a row.
_COLUMN = re.compile(r"`([a-z]+)`")


def described() -> Labels:
    """The metrics of the page, as queries name them, with their labels."""
    found: Labels = {"process_cpu_seconds_total": set(), "process_resident_memory_bytes": set()}
    histograms = METRICS.split("## Histograms")[1].split("## Gauges")[0]
    for names, labels in _ROW.findall(METRICS):
        columns = set(_COLUMN.findall(labels.partition(": `")[0]))
        for name in re.findall(r"`(skyway_[a-z_]+)`", names):
            if f"| `{name}` |" in histograms:
                found |= {f"{name}_bucket": columns | {"le"}}
                found |= {f"{name}_{end}": columns for end in ("sum", "count")}
            else:
                found[name] = columns
    return found


def test_rules_and_panels_ask_only_for_metrics_and_labels_of_the_page() -> None:
    shown = described()

    assert len(expressions()) > 60
    assert {each: faults for each in expressions() if (faults := faults_of(each, shown))} == {}


def test_a_wrong_name_or_label_is_found() -> None:
    shown: Labels = {"skyway_drones": {"state"}, "skyway_quotes_total": {"outcome"}}

    assert faults_of('max(skyway_drones{state="OFFLINE", job="skyway"})', shown) == []
    assert faults_of("max by (state, instance) (skyway_drones)", shown) == []
    assert faults_of("skyway_birds", shown) == ["skyway_birds"]
    assert faults_of('skyway_drones{colour=~"red|blue"}', shown) == ["skyway_drones{colour}"]
    assert faults_of("sum by (state) (rate(skyway_quotes_total[5m]))", shown) == ["by (state)"]


def test_every_alert_has_a_summary_a_severity_and_a_part_of_the_page() -> None:
    rules = alert_rules()
    parts = re.findall(r"^## (Skyway\w+)$", PAGE, re.MULTILINE)

    assert parts == [rule["alert"] for rule in rules]
    for rule in rules:
        assert rule["labels"]["severity"] in ("critical", "warning", "info")
        assert rule["annotations"]["summary"].endswith(".")
        link = f"docs/reference/alerts.md#{rule['alert'].lower()}"
        assert rule["annotations"]["runbook_url"] == link


def test_a_summary_names_only_labels_that_its_expression_keeps() -> None:
    for rule in alert_rules():
        expression = rule["expr"]
        kept = re.findall(r"\b(?:max|min|sum)(?: by \(([^)]*)\))?\s*\(", expression)
        named = set(re.findall(r"\$labels\.(\w+)", rule["annotations"]["summary"]))
        if kept:
            grouped = {label.strip() for group in kept for label in group.split(",")}
            assert named <= grouped, rule["alert"]


def test_the_board_is_the_one_that_its_tool_writes() -> None:
    assert BOARD.read_text() == board_text(), "run tools/write_board.py"
