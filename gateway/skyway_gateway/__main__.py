"""Runs the gateway: ``python -m skyway_gateway [serve | migrate | archive]``."""

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from skyway.runtime.loading import begin_loading

if TYPE_CHECKING:
    from skyway.runtime.archive import ArchivedTable


def main() -> int:
    """Run the command; the exit code."""
    begin_loading()
    from skyway.runtime.service_process import ServiceProcess
    from skyway_gateway.settings import GatewaySettings

    def serve(settings: GatewaySettings) -> int:
        from skyway.runtime.http.serving import serve
        from skyway_gateway.app import build_app

        return serve(build_app(settings), settings)

    def archived() -> "Sequence[ArchivedTable]":
        from skyway_gateway.retention.archived_tables import ARCHIVED

        return ARCHIVED

    return ServiceProcess("gateway", "skyway_gateway", GatewaySettings, serve, archived).run()


if __name__ == "__main__":
    sys.exit(main())
