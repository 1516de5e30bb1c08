"""Once the planner is warm, nothing is compiled or loaded any more."""

import subprocess
import sys

COUNT_AFTER_WARMING = """
import importlib, pkgutil
from skyway.planner import kernels
from skyway.planner.compose import compose
from skyway.planner.problem import Problem
from skyway.planner.warm import warm
from skyway.drone.models import PAPER_SCENARIO
from skyway.network.bundled import texas_corridor

def compiled():
    modules = [importlib.import_module(f"{kernels.__name__}.{found.name}")
               for found in pkgutil.iter_modules(kernels.__path__)]
    return {(name, str(signature)) for module in modules for name, each in vars(module).items()
            for signature in getattr(each, "signatures", ())}

warm()
before = compiled()
for policy in ("partial", "full"):
    for closures in ([], [{"station_id": "kyle", "start_s": 0.0, "end_s": 900.0}]):
        for station in (None, "seguin"):
            compose(Problem.model_validate({
                "network": texas_corridor(),
                "drone": {"model": PAPER_SCENARIO, "soc": 0.9, "station_id": station},
                "source": "san-marcos",
                "packages": [{"package_id": "p", "mass_kg": 0.5, "destination": "san-antonio"},
                             {"package_id": "q", "mass_kg": 0.5, "destination": "bulverde"}],
                "pad_reservations": [{"station_id": "schertz", "pad": 0, "start_s": 0.0}],
                "closures": closures,
                "recharge_policy": policy,
            }))
assert before
print(sorted(compiled() - before))
"""


def test_nothing_is_compiled_after_warming():
    # In a process of its own: another test may have compiled what warming forgets.
    done = subprocess.run(
        [sys.executable, "-c", COUNT_AFTER_WARMING], capture_output=True, text=True, check=False
    )

    assert (done.stderr, done.stdout.strip()) == ("", "[]")
