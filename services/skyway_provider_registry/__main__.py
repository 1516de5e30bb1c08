"""Runs the registry: ``python -m skyway_provider_registry [serve | migrate]``."""

import sys

from skyway.runtime.loading import begin_loading

_PACKAGE = "skyway_provider_registry"


def main() -> int:
    """Run the command; the exit code."""
    begin_loading()
    from skyway.runtime.service_process import ServiceProcess
    from skyway_provider_registry.settings import RegistrySettings

    def serve(settings: RegistrySettings) -> int:
        from skyway.runtime.http.serving import serve
        from skyway_provider_registry.app import build_app

        return serve(build_app(settings), settings)

    return ServiceProcess("registry", _PACKAGE, RegistrySettings, serve, tuple).run()


if __name__ == "__main__":
    sys.exit(main())
