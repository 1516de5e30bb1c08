from skyway.delivery.plan import Fly
from skyway.planner import compose


def test_it_finds_the_longer_path_without_waiting(make_problem, taken):
    fields = {"pad_reservations": taken("b", 0, 9000), "strategy": "exhaustive"}

    plan = compose(make_problem("a-b:8 b-d:8 a-c:9 c-d:9", "d", **fields))

    assert [step.to_id for step in plan.steps if isinstance(step, Fly)] == ["c", "d"]


def test_simple_paths_cannot_turn_back_to_a_pad_and_walks_can(make_problem):
    problem = make_problem("a-b:6 b-p:2 b-c:6", "c", pads={"b": 0})

    simple = compose(problem.model_copy(update={"strategy": "exhaustive"}))
    walks = compose(problem.model_copy(update={"strategy": "exhaustive_with_walks"}))

    assert simple.status == "unknown"
    assert [step.to_id for step in walks.steps if isinstance(step, Fly)] == ["b", "p", "b", "c"]


def test_its_effort_grows_exponentially_with_the_network(make_problem):
    def labels(stations: str) -> int:
        complete = " ".join(f"{a}-{b}:1" for a in stations for b in stations if a < b)
        problem = make_problem(complete, "b", strategy="exhaustive")
        return int(compose(problem).stats["labels"])

    assert labels("abcdef") > 3 * labels("abcde") > 9 * labels("abcd")
