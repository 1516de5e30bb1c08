"""Spans for an OpenTelemetry collector."""

import sys
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread
from typing import Any

import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from skyway.runtime.errors import InvalidSettings
from skyway.runtime.tracing import SPANS, export_spans, in_trace_of, tracing

TRACE_ID = "4bf92f3577b34da6a3ce929d0e0e4736"
RECEIVED = f"00-{TRACE_ID}-00f067aa0ba902b7-01"
NOT_SAMPLED = f"00-{TRACE_ID}-00f067aa0ba902b7-00"


class Collector:
    """A collector on a port of its own."""

    def __init__(self) -> None:
        self.requests: list[ExportTraceServiceRequest] = []
        received = self.requests

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                received.append(ExportTraceServiceRequest.FromString(body))
                self.send_response(200)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self.server = HTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/v1/traces"

    def spans(self) -> list[Any]:
        return [
            span
            for request in self.requests
            for resource in request.resource_spans
            for scope in resource.scope_spans
            for span in scope.spans
        ]

    def services(self) -> set[str]:
        return {
            attribute.value.string_value
            for request in self.requests
            for resource in request.resource_spans
            for attribute in resource.resource.attributes
            if attribute.key == "service.name"
        }


@pytest.fixture
def collector() -> Iterator[Collector]:
    opened = Collector()
    thread = Thread(target=opened.server.serve_forever)
    thread.start()
    yield opened
    opened.server.shutdown()
    opened.server.server_close()
    thread.join()


def test_spans_arrive_with_their_trace_and_their_parent(collector: Collector) -> None:
    export = export_spans("gateway", collector.url)
    with tracing(RECEIVED, "outer") as outer:
        pass
    with pytest.raises(ValueError, match="broken"), in_trace_of(RECEIVED, "inner"):
        raise ValueError("broken")
    export.close()

    first, second = collector.spans()
    assert collector.services() == {"skyway-gateway"}
    assert (first.name, second.name) == ("outer", "inner")
    assert {span.trace_id.hex() for span in (first, second)} == {TRACE_ID}
    assert {span.parent_span_id.hex() for span in (first, second)} == {"00f067aa0ba902b7"}
    assert first.span_id.hex() == outer.split("-")[2]
    assert first.start_time_unix_nano <= first.end_time_unix_nano
    assert (first.status.code, second.status.code) == (0, 2)


def test_spans_that_their_caller_does_not_sample_stay_here(collector: Collector) -> None:
    export = export_spans("gateway", collector.url)
    with tracing(NOT_SAMPLED, "unsampled"):
        pass
    export.close()

    assert collector.spans() == []


def test_without_an_export_nothing_is_recorded() -> None:
    assert SPANS.recorder is None


def test_without_opentelemetry_the_setting_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "opentelemetry.sdk.trace", None)

    with pytest.raises(InvalidSettings, match=r"pip install 'skyway\[otlp\]'"):
        export_spans("gateway", "http://127.0.0.1:1/v1/traces")
