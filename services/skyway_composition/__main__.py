"""Runs composition: ``python -m skyway_composition [serve | migrate | verify | archive]``."""

import sys
from typing import Final

from skyway.runtime.garbage import load_without_collecting

_PACKAGE: Final = "skyway_composition"


def _run() -> int:
    from skyway.runtime.service_process import ServiceProcess, StoredData
    from skyway_composition.settings import CompositionSettings

    def serve(settings: CompositionSettings) -> int:
        from skyway.runtime.http.serving import serve
        from skyway_composition.app import build_app

        return serve(build_app(settings), settings)

    def data() -> StoredData:
        from skyway_composition.retention.archived_tables import ARCHIVED
        from skyway_composition.verify.rules import FACTS, RULES

        return StoredData(RULES, FACTS, ARCHIVED)

    return ServiceProcess("composition", _PACKAGE, CompositionSettings, serve, data).run()


def main() -> int:
    """Run the command; the exit code."""
    load_without_collecting()
    return _run()


if __name__ == "__main__":
    sys.exit(main())
