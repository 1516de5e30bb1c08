"""Runs composition: ``python -m skyway_composition [serve | migrate | archive]``."""

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from skyway.runtime.loading import begin_loading

if TYPE_CHECKING:
    from skyway.runtime.archive import ArchivedTable

_PACKAGE: Final = "skyway_composition"


def _run() -> int:
    from skyway.runtime.service_process import ServiceProcess
    from skyway_composition.settings import CompositionSettings

    def serve(settings: CompositionSettings) -> int:
        from skyway.runtime.http.serving import serve
        from skyway_composition.app import build_app

        return serve(build_app(settings), settings)

    def archived() -> "Sequence[ArchivedTable]":
        from skyway_composition.retention.archived_tables import ARCHIVED

        return ARCHIVED

    return ServiceProcess("composition", _PACKAGE, CompositionSettings, serve, archived).run()


def main() -> int:
    """Run the command; the exit code."""
    begin_loading()
    return _run()


if __name__ == "__main__":
    sys.exit(main())
