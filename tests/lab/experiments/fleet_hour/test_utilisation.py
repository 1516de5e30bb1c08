"""How the time of a mission is divided among uses."""

from skyway_lab.experiments.fleet_hour.utilisation import StepTime, spent_ms

#: To the pickup with a recharge on the way, a delivery with a recharge, the way home, a recharge.
STEPS = (
    StepTime("FLY", 0, 10),
    StepTime("RECHARGE", 10, 20),
    StepTime("FLY", 20, 25),
    StepTime("PICK_UP", 25, 30),
    StepTime("FLY", 30, 40),
    StepTime("RECHARGE", 40, 50),
    StepTime("WAIT", 50, 52),
    StepTime("DELIVER", 52, 60),
    StepTime("FLY", 60, 70),
    StepTime("WAIT", 70, 71),
    StepTime("RECHARGE", 71, 100),
)


def test_every_moment_of_a_mission_belongs_to_one_activity() -> None:
    spent = spent_ms(STEPS, served_ms=60, from_ms=0, until_ms=1_000)

    assert spent == {"approach": 15, "service": 25, "standby": 11, "charging": 49}


def test_only_the_time_within_the_span_counts() -> None:
    spent = spent_ms(STEPS, served_ms=60, from_ms=22, until_ms=75)

    assert spent == {"approach": 3, "service": 25, "standby": 11, "charging": 14}
