"""Several mission reports in one request: each request costs more than the reports in it."""

from typing import Annotated, Final

from pydantic import Field

from skyway.contracts.mission import MissionReport
from skyway.json_model import WireModel

#: Where a report goes alone, and where several do, with the gateway and with the registry.
MISSION_REPORTS: Final = "/internal/mission-reports"
MANY_MISSION_REPORTS: Final = "/internal/mission-reports/many"


class TracedReport(WireModel):
    """A report, and the trace that it belongs to."""

    traceparent: Annotated[
        str | None, Field(description="The W3C trace context of the report.")
    ] = None
    report: Annotated[MissionReport, Field(description="The report.")]


class MissionReports(WireModel):
    """Reports of different missions; when one is refused, each is to be sent again alone."""

    reports: Annotated[tuple[TracedReport, ...], Field(description="The reports, in order.")]
