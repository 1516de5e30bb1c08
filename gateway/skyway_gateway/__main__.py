"""Runs the gateway: ``python -m skyway_gateway [serve | migrate | verify]``."""

import sys

from skyway.runtime.service_process import ServiceProcess
from skyway_gateway.app import PACKAGE, build_app
from skyway_gateway.parts import SERVICE
from skyway_gateway.settings import GatewaySettings
from skyway_gateway.verify import violations

if __name__ == "__main__":
    sys.exit(ServiceProcess(SERVICE, PACKAGE, GatewaySettings, build_app, violations).run())
