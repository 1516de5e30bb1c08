"""Runs the registry: ``python -m skyway_provider_registry [serve | migrate | verify]``."""

import sys

from skyway.runtime.service_process import ServiceProcess
from skyway_provider_registry.settings import RegistrySettings
from skyway_provider_registry.verify import FACTS, RULES


def _serve(settings: RegistrySettings) -> int:
    # Imported here: the other commands do without the app.
    from skyway.runtime.http.serving import serve
    from skyway_provider_registry.app import build_app

    return serve(build_app(settings), settings)


if __name__ == "__main__":
    process = ServiceProcess(
        "registry", "skyway_provider_registry", RegistrySettings, _serve, RULES, FACTS
    )
    sys.exit(process.run())
