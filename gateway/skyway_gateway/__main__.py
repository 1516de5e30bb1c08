"""Runs the gateway: ``python -m skyway_gateway [serve | migrate | verify | archive]``."""

import sys

from skyway.runtime.service_process import ServiceProcess
from skyway_gateway.retention.archived_tables import ARCHIVED
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.verify.facts import FACTS
from skyway_gateway.verify.rules import RULES


def _serve(settings: GatewaySettings) -> int:
    # Imported here: the other commands do without the app.
    from skyway.runtime.http.serving import serve
    from skyway_gateway.app import build_app

    return serve(build_app(settings), settings)


if __name__ == "__main__":
    process = ServiceProcess(
        "gateway", "skyway_gateway", GatewaySettings, _serve, RULES, FACTS, ARCHIVED
    )
    sys.exit(process.run())
