"""Runs the registry: ``python -m skyway_provider_registry [serve | migrate | verify]``."""

import sys

from skyway.runtime.service_process import ServiceProcess
from skyway_provider_registry.app import PACKAGE, build_app
from skyway_provider_registry.parts import SERVICE
from skyway_provider_registry.settings import RegistrySettings
from skyway_provider_registry.verify import violations

if __name__ == "__main__":
    sys.exit(ServiceProcess(SERVICE, PACKAGE, RegistrySettings, build_app, violations).run())
