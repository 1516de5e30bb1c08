from datetime import timedelta

import pytest
from pydantic import ValidationError

from skyway.delivery.offer import Tariff
from skyway.delivery.payment_terms import LateStep, PaymentTerms


def test_without_terms_a_cancellation_in_flight_costs_the_whole_price() -> None:
    terms = Tariff().payment_terms

    assert (terms.cancellation.until_loaded, terms.cancellation.in_flight) == (0, 1)
    assert terms.late_share(timedelta(days=365)) == 0


@pytest.mark.parametrize(
    ("minutes", "share"), [(-5, 0), (0, 0), (10, 0), (10.5, 0.1), (60, 0.1), (60.1, 1)]
)
def test_the_last_step_that_was_passed_counts(minutes: float, share: float) -> None:
    late = (LateStep(after_min=10, share=0.1), LateStep(after_min=60, share=1))

    assert PaymentTerms(late=late).late_share(timedelta(minutes=minutes)) == share


@pytest.mark.parametrize(
    ("terms", "fault"),
    [
        ({"cancellation": {"in_flight": 1.1}}, "less than or equal to 1"),
        ({"cancellation": {"until_loaded": -0.1}}, "greater than or equal to 0"),
        ({"cancellation": {"until_loaded": 0.5, "in_flight": 0.4}}, "0.4 must not be below"),
        ({"cancellation": {"until_loaded": float("nan")}}, "finite"),
        ({"cancellation": {"until_loaded": "0.5"}}, "valid number"),
        ({"late": [{"after_min": 5, "share": 2}]}, "less than or equal to 1"),
        ({"late": [{"after_min": -5, "share": 0}]}, "greater than or equal to 0"),
        (
            {"late": [{"after_min": 5, "share": 0.2}, {"after_min": 5, "share": 0.3}]},
            "more minutes and no lower share",
        ),
        (
            {"late": [{"after_min": 5, "share": 0.2}, {"after_min": 9, "share": 0.1}]},
            "more minutes and no lower share",
        ),
        ({"late": [{"after_min": each, "share": 0} for each in range(11)]}, "at most 10"),
    ],
)
def test_terms_outside_their_limits_are_refused(terms: dict[str, object], fault: str) -> None:
    with pytest.raises(ValidationError, match=fault):
        Tariff.model_validate({"payment_terms": terms})
