"""What deploy/helm/skyway repeats of the project is the same there."""

from tools.write_chart import NOT_FOR_VALUES, SERVICES, files


def test_the_chart_has_what_its_tool_writes() -> None:
    different = [str(path) for path, text in files().items() if path.read_text() != text]

    assert not different, "run python tools/write_chart.py"


def test_every_setting_that_is_left_out_exists() -> None:
    fields = {name for settings in SERVICES.values() for name in settings.model_fields}

    assert fields >= NOT_FOR_VALUES
