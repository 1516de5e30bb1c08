"""Runs the gateway: ``python -m skyway_gateway [serve | migrate | verify | archive]``."""

import sys

from skyway.runtime.garbage import load_without_collecting


def main() -> int:
    """Run the command; the exit code."""
    load_without_collecting()
    from skyway.runtime.service_process import ServiceProcess, StoredData
    from skyway_gateway.settings import GatewaySettings

    def serve(settings: GatewaySettings) -> int:
        from skyway.runtime.http.serving import serve
        from skyway_gateway.app import build_app

        return serve(build_app(settings), settings)

    def data() -> StoredData:
        from skyway_gateway.retention.archived_tables import ARCHIVED
        from skyway_gateway.verify.facts import FACTS
        from skyway_gateway.verify.rules import RULES

        return StoredData(RULES, FACTS, ARCHIVED)

    return ServiceProcess("gateway", "skyway_gateway", GatewaySettings, serve, data).run()


if __name__ == "__main__":
    sys.exit(main())
