"""Write deploy/grafana/skyway.json: a board for Grafana with the metrics of all services.

python tools/write_board.py
"""

import json
from pathlib import Path
from typing import Any, Final, NamedTuple

BOARD: Final = Path(__file__).resolve().parent.parent / "deploy/grafana/skyway.json"

#: The width of the board and the size of a panel, in Grafana's units.
_BOARD_WIDTH: Final = 24
_WIDTH, _HEIGHT = 8, 8

_SOURCE: Final = {"type": "prometheus", "uid": "${datasource}"}


class Curves(NamedTuple):
    """A panel: its title, its unit, and each query with its legend."""

    title: str
    unit: str
    queries: tuple[tuple[str, str], ...]


def _quantiles(metric: str, by: str) -> tuple[tuple[str, str], ...]:
    """The median and the slowest hundredth of a histogram, by one label."""
    labels = f"le, {by}" if by else "le"
    legend = f"{{{{{by}}}}} " if by else ""
    rates = f"sum by ({labels}) (rate({metric}_bucket[$__rate_interval]))"
    return tuple(
        (f"histogram_quantile({share}, {rates})", f"{legend}p{share * 100:g}")
        for share in (0.5, 0.99)
    )


_SLOWEST: Final = (
    "topk(8, histogram_quantile(0.99, sum by (le, method, route) "
    "(rate(skyway_http_request_duration_seconds_bucket[5m]))))"
)

_KEPT_PROMISES: Final = " / ".join(
    f'sum by (network) (max by (network, provider) ({name}{{span="week"}}))'
    for name in ("skyway_promised_packages_in_time", "skyway_promised_packages")
)

ROWS: Final[tuple[tuple[str, tuple[Curves, ...]], ...]] = (
    (
        "Deliveries",
        (
            Curves(
                "Deliveries by state",
                "short",
                (("max by (state) (skyway_deliveries)", "{{state}}"),),
            ),
            Curves(
                "Missions by state", "short", (("max by (state) (skyway_missions)", "{{state}}"),)
            ),
            Curves(
                "Packages by their P90, week",
                "percentunit",
                (
                    (
                        _KEPT_PROMISES,
                        "{{network}}",
                    ),
                ),
            ),
            Curves(
                "Events for customers",
                "ops",
                (("sum by (type) (rate(skyway_delivery_events_total[5m]))", "{{type}}"),),
            ),
        ),
    ),
    (
        "Drones",
        (
            Curves("Drones by state", "short", (("max by (state) (skyway_drones)", "{{state}}"),)),
            Curves(
                "Open alarms",
                "short",
                (("max by (level, code) (skyway_alarms_open) > 0", "{{level}} {{code}}"),),
            ),
            Curves(
                "Age of what drones say",
                "s",
                (
                    ("min(skyway_telemetry_age_seconds)", "newest sample"),
                    ("max(skyway_drone_lag_mean_seconds)", "mean lag"),
                    ("max(skyway_drone_lag_max_seconds)", "longest lag"),
                    ("max by (instance) (skyway_mqtt_inbox_age_seconds)", "inbox {{instance}}"),
                ),
            ),
        ),
    ),
    (
        "Booking and planning",
        (
            Curves(
                "Booking",
                "s",
                (
                    *_quantiles("skyway_booking_duration_seconds", "outcome"),
                    *_quantiles("skyway_booking_round_duration_seconds", ""),
                ),
            ),
            Curves("Planning", "s", _quantiles("skyway_planning_duration_seconds", "queue")),
            Curves(
                "Plans under way and waiting",
                "short",
                (
                    ("sum by (queue) (skyway_planning_depth)", "planning {{queue}}"),
                    ("max(skyway_missions_to_replan)", "missions to replan"),
                    ("sum by (by) (rate(skyway_booking_conflicts_total[5m]))", "conflict {{by}}"),
                ),
            ),
        ),
    ),
    (
        "Queues and messages",
        (
            Curves(
                "Queues",
                "short",
                (
                    ("max by (queue) (skyway_queue_depth)", "{{queue}}"),
                    ("max(skyway_quarantine_depth)", "quarantine"),
                    ("sum(skyway_telemetry_depth)", "telemetry"),
                    ("sum by (instance) (skyway_mqtt_inbox_depth)", "inbox {{instance}}"),
                ),
            ),
            Curves(
                "Age of queues and outboxes",
                "s",
                (
                    ("max by (queue) (skyway_queue_age_seconds)", "{{queue}}"),
                    (
                        "max by (instance, channel) (skyway_outbox_age_seconds)",
                        "outbox {{instance}} {{channel}}",
                    ),
                ),
            ),
            Curves(
                "From storing a message to sending it",
                "s",
                _quantiles("skyway_outbox_delay_seconds", "channel"),
            ),
            Curves(
                "Outboxes",
                "short",
                (
                    (
                        "max by (instance, channel) (skyway_outbox_depth)",
                        "{{instance}} {{channel}}",
                    ),
                ),
            ),
            Curves(
                "Webhooks",
                "ops",
                (("sum by (outcome) (rate(skyway_webhook_attempts_total[5m]))", "{{outcome}}"),),
            ),
            Curves(
                "Webhook answers", "s", _quantiles("skyway_webhook_duration_seconds", "outcome")
            ),
        ),
    ),
    (
        "Requests",
        (
            Curves(
                "Requests",
                "reqps",
                (
                    (
                        "sum by (instance, status) (rate(skyway_http_requests_total[5m]))",
                        "{{instance}} {{status}}",
                    ),
                ),
            ),
            Curves(
                "Time until the answer",
                "s",
                _quantiles("skyway_http_request_duration_seconds", "instance"),
            ),
            Curves(
                "Slowest routes",
                "s",
                (
                    (
                        _SLOWEST,
                        "{{method}} {{route}}",
                    ),
                ),
            ),
        ),
    ),
    (
        "Services",
        (
            Curves(
                "Parts that are there",
                "short",
                (("min by (instance, part) (skyway_part_ready)", "{{instance}} {{part}}"),),
            ),
            Curves(
                "Processor",
                "percentunit",
                (('rate(process_cpu_seconds_total{job="skyway"}[1m])', "{{instance}}"),),
            ),
            Curves(
                "Memory",
                "bytes",
                (('process_resident_memory_bytes{job="skyway"}', "{{instance}}"),),
            ),
            Curves(
                "Failures",
                "short",
                (
                    (
                        "sum by (loop) (increase(skyway_loop_failures_total[5m])) > 0",
                        "loop {{loop}}",
                    ),
                    ("sum(increase(skyway_database_trouble_total[5m]))", "database"),
                    ("sum(increase(skyway_outbox_failures_total[5m]))", "outbox"),
                ),
            ),
            Curves(
                "Refused",
                "short",
                (
                    ("sum by (reason) (increase(skyway_keys_refused_total[5m]))", "key {{reason}}"),
                    ("sum(increase(skyway_forged_messages_total[5m]))", "forged messages"),
                    (
                        "sum by (reason) (increase(skyway_telemetry_dropped_total[5m]))",
                        "samples {{reason}}",
                    ),
                ),
            ),
            Curves(
                "The live picture",
                "short",
                (
                    ("sum(skyway_live_viewers)", "viewers"),
                    ("max(skyway_live_age_seconds)", "age, s"),
                ),
            ),
        ),
    ),
)


def board() -> dict[str, Any]:  # JSON
    """The board as Grafana imports it."""
    panels: list[dict[str, Any]] = []
    y = 0
    for title, shown in ROWS:
        panels.append(_row(len(panels) + 1, title, y))
        y += 1
        for number, curves in enumerate(shown):
            x = number * _WIDTH % _BOARD_WIDTH
            line = number * _WIDTH // _BOARD_WIDTH
            panels.append(_panel(len(panels) + 1, curves, x=x, y=y + line * _HEIGHT))
        y += -(-len(shown) * _WIDTH // _BOARD_WIDTH) * _HEIGHT
    return {
        "title": "Skyway",
        "uid": "skyway",
        "tags": ["skyway"],
        "schemaVersion": 39,
        "editable": True,
        "refresh": "15s",
        "time": {"from": "now-1h", "to": "now"},
        "templating": {
            "list": [{"name": "datasource", "type": "datasource", "query": "prometheus"}]
        },
        "panels": panels,
    }


def _row(number: int, title: str, y: int) -> dict[str, Any]:
    place = {"x": 0, "y": y, "w": _BOARD_WIDTH, "h": 1}
    return {"id": number, "type": "row", "title": title, "gridPos": place, "panels": []}


def _panel(number: int, curves: Curves, *, x: int, y: int) -> dict[str, Any]:
    return {
        "id": number,
        "type": "timeseries",
        "title": curves.title,
        "datasource": _SOURCE,
        "gridPos": {"x": x, "y": y, "w": _WIDTH, "h": _HEIGHT},
        "fieldConfig": {"defaults": {"unit": curves.unit, "min": 0}, "overrides": []},
        "targets": [
            {"refId": chr(ord("A") + place), "expr": query, "legendFormat": legend}
            for place, (query, legend) in enumerate(curves.queries)
        ],
    }


def board_text() -> str:
    """The file."""
    return json.dumps(board(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    BOARD.parent.mkdir(parents=True, exist_ok=True)
    BOARD.write_text(board_text())
