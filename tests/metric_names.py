"""Which metrics and labels the alert rules and the board ask for, and which a service shows."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml
from prometheus_client.parser import text_string_to_metric_families

ROOT = Path(__file__).parents[1]
ALERTS = ROOT / "deploy/prometheus/alerts.yml"
BOARD = ROOT / "deploy/grafana/skyway.json"

#: Prometheus adds these to every series.
OWN_LABELS = {"instance", "job"}

_METRIC = re.compile(r"\b(skyway_[a-z_]+|process_[a-z_]+)(?:\{([^}]*)\})?")
_LABEL = re.compile(r"(\w+)\s*(?:=~|!~|!=|=)")
_GROUP = re.compile(r"\b(?:by|on|without|ignoring) \(([^)]*)\)")

#: The labels of each metric by its name in queries.
Labels = dict[str, set[str]]


def alert_rules() -> list[dict[str, Any]]:
    """All rules of deploy/prometheus/alerts.yml."""
    groups = yaml.safe_load(ALERTS.read_text())["groups"]
    return [rule for group in groups for rule in group["rules"]]


def expressions() -> list[str]:
    """The expressions of all rules and all panels."""
    panels = json.loads(BOARD.read_text())["panels"]
    asked = [target["expr"] for panel in panels for target in panel.get("targets", ())]
    return [*(rule["expr"] for rule in alert_rules()), *asked]


def faults_of(expression: str, shown: Mapping[str, set[str]]) -> list[str]:
    """What an expression asks for that is not among the metrics and labels `shown`."""
    faults, known = list[str](), set(OWN_LABELS)
    for name, selector in _METRIC.findall(expression):
        if name not in shown:
            faults.append(name)
            continue
        known |= shown[name]
        asked = set(_LABEL.findall(selector))
        faults += [f"{name}{{{label}}}" for label in sorted(asked - shown[name] - OWN_LABELS)]
    for group in _GROUP.findall(expression):
        names = {each.strip() for each in group.split(",") if each.strip()}
        faults += [f"by ({label})" for label in sorted(names - known)]
    return faults


def shown_in(texts: Iterable[str]) -> Labels:
    """The metrics of these answers of GET /metrics, with the labels of their series."""
    shown: Labels = defaultdict(set)
    for text in texts:
        for family in text_string_to_metric_families(text):
            for sample in family.samples:
                shown[sample.name] |= set(sample.labels)
    return dict(shown)
