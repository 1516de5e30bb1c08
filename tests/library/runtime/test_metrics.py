"""What a process counts."""

import subprocess
import sys

from skyway.runtime.exposition import exposition
from skyway.runtime.metrics import Counters, count


def test_a_counter_grows_for_each_set_of_labels() -> None:
    counters = Counters()

    counters.add("skyway_tests", "tests", channel="a")
    counters.add("skyway_tests", "tests", 2.0, channel="a")
    counters.add("skyway_tests", "tests", channel="b")

    assert counters.value("skyway_tests", channel="a") == 3.0
    assert counters.value("skyway_tests", channel="b") == 1.0
    assert counters.value("skyway_tests") == 0.0


def test_counters_are_exposed() -> None:
    count("skyway_exposed_tests", "tests that expose themselves", kind="unit")

    body, content_type = exposition()

    assert b'skyway_exposed_tests_total{kind="unit"} 1.0' in body
    assert b"# HELP skyway_exposed_tests_total tests that expose themselves" in body
    assert content_type.startswith("text/plain")


def test_counting_does_not_load_prometheus() -> None:
    script = "import sys, skyway.runtime.loops; print('prometheus_client' in sys.modules)"

    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)

    assert done.stdout.strip() == b"False"
