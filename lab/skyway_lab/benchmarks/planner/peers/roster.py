"""Which peers there are, and which of them are installed."""

from importlib import import_module
from typing import Any

from skyway_lab.benchmarks.planner.machine import installed

#: Modules of this package by what they can do, with the class in each and its name on PyPI.
_ORDER = (
    ("ortools_order", "OrToolsOrder", "ortools"),
    ("pyvrp_order", "PyVrpOrder", "pyvrp"),
    ("pyvroom_order", "PyVroomOrder", "pyvroom"),
)
_CHARGING = (("frvcpy_charging", "FrvcpyCharging", "frvcpy"),)
_PATHS = (
    ("networkx_paths", "NetworkxPaths", "networkx"),
    ("rustworkx_paths", "RustworkxPaths", "rustworkx"),
    ("igraph_paths", "IgraphPaths", "igraph"),
    ("scipy_paths", "ScipyPaths", "scipy"),
)
ROSTER = {"order": _ORDER, "charging": _CHARGING, "paths": _PATHS}


def peers(kind: str) -> list[Any]:  # OrderPeer, ChargingPeer or PathPeer, by the kind
    """The installed peers of this kind, each made once."""
    return [
        getattr(import_module(f"skyway_lab.benchmarks.planner.peers.{module}"), name)()
        for module, name, package in ROSTER[kind]
        if installed(package)
    ]


def missing(kind: str) -> list[str]:
    """A line for each peer of this kind that is not installed."""
    return [
        f"{package} is not installed and left out (`make benchmark` installs it)"
        for _, _, package in ROSTER[kind]
        if not installed(package)
    ]


def label(package: str) -> str:
    """A peer's name with its version."""
    return f"{package} {installed(package)}"
