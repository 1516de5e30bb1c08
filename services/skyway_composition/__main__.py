"""Runs composition: ``python -m skyway_composition [serve | migrate | verify | archive]``."""

import sys

from skyway.runtime.service_process import ServiceProcess
from skyway_composition.retention.archived_tables import ARCHIVED
from skyway_composition.settings import CompositionSettings
from skyway_composition.verify.rules import FACTS, RULES


def _serve(settings: CompositionSettings) -> int:
    # Imported here: the other commands do without the app.
    from skyway.runtime.http.serving import serve
    from skyway_composition.app import build_app

    return serve(build_app(settings), settings)


if __name__ == "__main__":
    process = ServiceProcess(
        "composition", "skyway_composition", CompositionSettings, _serve, RULES, FACTS, ARCHIVED
    )
    sys.exit(process.run())
