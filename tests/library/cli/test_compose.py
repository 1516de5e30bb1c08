"""`skyway compose`: problems in many forms, plans in order, and faults by line and field."""

import json
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from skyway.cli.compose import compose_command

APP = typer.Typer()
APP.command()(compose_command)


def point(name: str, longitude: float) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [longitude, 0]},
        "properties": {"kind": "station", "station_id": name},
    }


def make_problem(**fields: Any) -> dict[str, Any]:
    line = {
        "type": "Feature",
        "geometry": {"type": "LineString", "coordinates": [[0, 0], [0.01, 0]]},
        "properties": {"kind": "segment", "from": "a", "to": "b", "length_m": 2300},
    }
    model = {
        "model_id": "m",
        "empty_mass_kg": 6.3,
        "max_payload_kg": 2.7,
        "battery_j": 1972800,
        "speed_empty_mps": 23.0,
        "speed_full_mps": 23.0,
        "power_empty_w": 598.0,
        "charge_curve": [[0, 0], [7740, 1]],
    }
    return {
        "network": {
            "type": "FeatureCollection",
            "features": [point("a", 0), point("b", 0.01), line],
        },
        "drone": {"model": model, "soc": 1.0},
        "source": "a",
        "packages": [{"package_id": "p1", "mass_kg": 0.7, "destination": "b"}],
        **fields,
    }


def run(text: str | bytes, *options: str) -> tuple[int, list[dict[str, Any]], str]:
    """Exit code, plans on standard output, messages on standard error."""
    result = CliRunner().invoke(APP, ["-", *options], input=text)
    return (
        result.exit_code,
        [json.loads(line) for line in result.stdout.splitlines()],
        result.stderr,
    )


UNKNOWN = json.dumps(make_problem(strategy="exhaustive", label_limit=1))
GOOD = json.dumps(make_problem())


def test_one_problem_may_be_spread_over_lines(tmp_path: Path):
    file = tmp_path / "problem.json"
    file.write_text(json.dumps(make_problem(), indent=2))

    result = CliRunner().invoke(APP, [str(file)])

    assert result.exit_code == 0
    assert json.loads(result.stdout)["delivery_time_s"] == pytest.approx(100.0)


def test_json_lines_give_one_plan_per_line_in_order():
    heavy = json.dumps(
        make_problem(packages=[{"package_id": "p", "mass_kg": 9, "destination": "b"}])
    )

    code, plans, messages = run(f"{GOOD}\n\n{heavy}\n")

    assert (code, messages) == (0, "")
    assert plans[0]["delivery_time_s"] == pytest.approx(100.0)
    assert plans[1]["infeasibility"]["code"] == "OVERWEIGHT"


def test_unreadable_problems_are_named_by_line_and_field_and_skipped():
    negative = GOOD.replace('"mass_kg": 0.7', '"mass_kg": -0.7')
    nowhere = json.dumps(make_problem(source="x"))

    code, plans, messages = run(f"{negative}\n{GOOD}\n{nowhere}\n{{oops\n")

    assert code == 2
    assert len(plans) == 1
    assert messages.splitlines() == [
        "line 1: packages.0.mass_kg: must be at least 0, not -0.7",
        "line 3: source: no station is called 'x'",
        "line 4: problem: not JSON at column 2",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: problem: nothing to read"),
        ("[]", "line 1: problem: an array is not an object"),
        (
            GOOD.replace("0.7", "NaN"),
            "line 1: packages.0.mass_kg: must be a finite number, not nan",
        ),
        (b"\xff\xfe{", "line 1: problem: not"),
        ("[" * 100_000, "line 1: problem: not JSON"),
        (json.dumps(make_problem(), indent=2)[:-3], "line"),
        (json.dumps(make_problem(strategy="magic")), "line 1: strategy: 'magic' is not"),
        (json.dumps(make_problem(network=3)), "line 1: network: 3 is not an object"),
        (json.dumps(make_problem(speed=3)), "line 1: speed: is not a known field"),
        (
            GOOD.replace('"to": "b"', '"to": "x"'),
            "line 1: network.features.2.properties.to: ",
        ),
    ],
)
def test_a_document_that_is_not_a_problem_exits_with_2(text: str | bytes, message: str):
    code, plans, messages = run(text)

    assert (code, plans) == (2, [])
    assert messages.startswith(message)
    assert len(messages.splitlines()) == 1


def test_an_unknown_line_exits_with_3_unless_another_cannot_be_read():
    assert run(f"{GOOD}\n{UNKNOWN}\n")[0] == 3
    assert run(f"{UNKNOWN}\n{{oops\n{GOOD}\n")[0] == 2


def test_options_override_the_problem():
    code, plans, _ = run(
        UNKNOWN.replace('"label_limit": 1', '"time_limit_s": 1e-9'), "--time-limit", "9"
    )
    assert (code, plans[0]["delivery_time_s"]) == (0, pytest.approx(100.0))

    _, plans, _ = run(GOOD, "--strategy", "exhaustive")
    assert plans[0]["stats"]["strategy"] == "exhaustive"


@pytest.mark.parametrize(
    "options",
    [
        ("--strategy", "magic"),
        ("--time-limit", "0"),
        ("--time-limit", "nan"),
        ("--time-limit", "inf"),
    ],
)
def test_invalid_options_are_refused(options: tuple[str, str]):
    code, plans, messages = run(GOOD, *options)

    assert (code, plans) == (2, [])
    assert options[0] in messages


def test_every_fault_is_a_line_on_standard_error(bad_problems):
    code, plans, messages = run("".join(json.dumps(bad.document) + "\n" for bad in bad_problems))

    assert (code, plans) == (2, [])
    lines = messages.splitlines()
    assert len(lines) == len(bad_problems)
    for number, (bad, line) in enumerate(zip(bad_problems, lines, strict=True), start=1):
        assert line.startswith(f"line {number}: {bad.field}")
        assert bad.message in line


def test_all_faults_of_a_problem_are_lines_of_their_own():
    code, _, messages = run(json.dumps(make_problem(source=7, finish="home", loading_s=-1)))

    assert code == 2
    assert messages.splitlines() == [
        'line 1: source: must be text, such as "7", not 7',
        "line 1: finish: must be 'recharge' or 'stay', not 'home'",
        "line 1: loading_s: must be at least 0, not -1",
    ]


def test_networks_with_equal_looking_values_are_distinguished():
    good = make_problem()
    bad = json.loads(GOOD)
    good["network"]["features"][0]["properties"]["pads"] = 1
    bad["network"]["features"][0]["properties"]["pads"] = True

    code, plans, messages = run(f"{json.dumps(good)}\n{json.dumps(bad)}\n{json.dumps(good)}\n")

    assert (code, len(plans)) == (2, 2)
    assert messages.startswith("line 2: network.features.0.properties.pads: true is not a number")


def test_many_networks_take_turns():
    problems = []
    for length_m in (2300, 4600, 6900, 9200, 11500, 13800, 2300, 4600):
        problem = make_problem()
        problem["network"]["features"][2]["properties"]["length_m"] = length_m
        problems.append(problem)

    _, plans, _ = run("\n".join(map(json.dumps, problems)))

    times_s = [plan["delivery_time_s"] for plan in plans]
    assert times_s == pytest.approx([100, 200, 300, 400, 500, 600, 100, 200])


@pytest.mark.parametrize("text", [f"\n\n{GOOD}\n\n{{oops\n", f"\r\n\r\n{GOOD}\r\n\r\n{{oops\r\n"])
def test_blank_lines_count(text: str):
    code, plans, messages = run(text)

    assert (code, len(plans)) == (2, 1)
    assert messages.startswith("line 5: problem: not JSON")


def test_a_broken_first_line_does_not_hide_the_others():
    code, plans, messages = run(f"{{oops\n{GOOD}\n{GOOD}")

    assert (code, len(plans)) == (2, 2)
    assert messages.startswith("line 1: problem: not JSON")
