"""Runs composition: ``python -m skyway_composition [serve | migrate | verify]``."""

import sys

from skyway.runtime.service_process import ServiceProcess
from skyway_composition.app import PACKAGE, build_app
from skyway_composition.parts import SERVICE
from skyway_composition.settings import CompositionSettings
from skyway_composition.verify import violations

if __name__ == "__main__":
    sys.exit(ServiceProcess(SERVICE, PACKAGE, CompositionSettings, build_app, violations).run())
