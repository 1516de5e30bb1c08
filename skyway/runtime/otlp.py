"""Spans for an OpenTelemetry collector, in deployments that name one (`SKYWAY_OTLP_ENDPOINT`).

A thread of its own sends the spans, many in one request. When the collector is slow or away, spans
are dropped: nothing waits for it.
"""

import atexit
from dataclasses import dataclass
from typing import Any

from skyway.runtime.errors import InvalidSettings
from skyway.runtime.tracing import SPANS, FinishedSpan


@dataclass(frozen=True, slots=True)
class SpanExport:
    """The export of the spans of this process, until it is closed."""

    processor: Any  # OpenTelemetry's BatchSpanProcessor, whose methods have no types

    def close(self) -> None:
        """Send the spans that wait, and export no others."""
        SPANS.recorder = None
        self.processor.shutdown()


def export_spans(service: str, endpoint: str) -> SpanExport:
    """Send the spans of this process to a collector: OTLP over HTTP, as protobuf.

    Raises
    ------
    InvalidSettings
        OpenTelemetry is not installed.
    """
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import ReadableSpan
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
        from opentelemetry.trace import SpanContext, Status, StatusCode, TraceFlags
    except ImportError as error:
        detail = "SKYWAY_OTLP_ENDPOINT needs OpenTelemetry: pip install 'skyway[otlp]'"
        raise InvalidSettings(detail) from error
    resource = Resource.create({"service.name": f"skyway-{service}"})
    processor = BatchSpanProcessor(OTLPSpanExporter(endpoint=endpoint))

    def context(trace_id: str, span_id: str) -> SpanContext:
        sampled = TraceFlags(TraceFlags.SAMPLED)
        return SpanContext(
            int(trace_id, 16), int(span_id, 16), is_remote=False, trace_flags=sampled
        )

    def record(span: FinishedSpan) -> None:
        status = Status(StatusCode.ERROR if span.has_failed else StatusCode.UNSET)
        parent = None if span.parent_id is None else context(span.trace_id, span.parent_id)
        processor.on_end(
            ReadableSpan(
                span.name,
                context(span.trace_id, span.span_id),
                parent,
                resource,
                status=status,
                start_time=span.began_ns,
                end_time=span.ended_ns,
            )
        )

    SPANS.recorder = record
    export = SpanExport(processor)
    atexit.register(export.close)
    return export
