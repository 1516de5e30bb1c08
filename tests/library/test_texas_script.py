"""The script of docs/ that uses the library alone."""

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "docs" / "texas_corridor.py"


def test_the_script_plans_and_draws_the_corridor(tmp_path, capsys):
    spec = importlib.util.spec_from_file_location("texas_corridor", SCRIPT)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)

    plan = script.main(tmp_path)

    assert plan.status == "optimal"
    assert capsys.readouterr().out.startswith("optimal: delivered after")
    assert (tmp_path / "texas_corridor.png").read_bytes().startswith(b"\x89PNG")
