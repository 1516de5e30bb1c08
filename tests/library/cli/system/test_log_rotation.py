"""Logs stay small while their processes go on writing."""

from pathlib import Path

from skyway.cli.system.log_rotation import KEPT, rotate


def test_a_log_above_the_limit_is_set_aside_and_its_process_goes_on(tmp_path: Path) -> None:
    log = tmp_path / "gateway.log"
    with log.open("ab", buffering=0) as process:
        process.write(b"before\n")

        assert rotate(log, most_bytes=5)
        process.write(b"after\n")

    assert log.read_bytes() == b"after\n"
    assert (tmp_path / "gateway.log.1").read_bytes() == b"before\n"


def test_a_small_log_stays(tmp_path: Path) -> None:
    log = tmp_path / "gateway.log"
    log.write_text("12345")

    assert not rotate(log, most_bytes=5)
    assert [path.name for path in tmp_path.iterdir()] == ["gateway.log"]


def test_only_the_newest_logs_are_kept(tmp_path: Path) -> None:
    log = tmp_path / "gateway.log"
    for number in range(KEPT + 3):
        log.write_text(f"log {number}")
        rotate(log, most_bytes=0)

    kept = [(tmp_path / f"gateway.log.{n}").read_text() for n in range(1, KEPT + 1)]
    assert kept == [f"log {KEPT + 2 - n}" for n in range(KEPT)]
    assert len(list(tmp_path.iterdir())) == KEPT + 1


def test_a_log_that_is_set_aside_is_as_secret_as_before(tmp_path: Path) -> None:
    log = tmp_path / "gateway.log"
    log.touch(mode=0o600)
    log.write_text("12345")

    rotate(log, most_bytes=0)

    assert (tmp_path / "gateway.log.1").stat().st_mode & 0o777 == 0o600
