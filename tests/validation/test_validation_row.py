"""A row passes only where something was measured and the error is within the tolerance."""

import json
import math

import msgspec
import pytest

from dualbend.validation import table as validation
from dualbend.validation.row import absolute, at_least, at_most, relative
from dualbend.validation.table import Row, run_validation

KEYS = ["name", "checks", "measured", "reference", "unit", "error", "tolerance", "passed"]


def test_relative_error_is_of_the_reference_unless_a_scale_is_given() -> None:
    row = relative("force", 2.02, 2.0, "N", 0.02)
    assert row.error == pytest.approx(0.01)  # analytic
    assert row.passed
    assert relative("force", 0.02, 0.0, "N", 0.02, scale=2.0).error == pytest.approx(0.01)


def test_error_equal_to_the_tolerance_passes_and_more_does_not() -> None:
    assert absolute("moment", 1.25, 1.0, "N m", 0.25).passed
    assert not absolute("moment", 1.2501, 1.0, "N m", 0.25).passed
    assert not absolute("moment", 0.7499, 1.0, "N m", 0.25).passed


def test_bounds_are_one_sided() -> None:
    assert at_most("ratio", 0.1, 0.6, "1").passed
    assert at_most("ratio", 0.6, 0.6, "1").passed
    worse = at_most("ratio", 0.7, 0.6, "1")
    assert not worse.passed
    assert worse.error == pytest.approx(0.1)  # analytic: the excess
    assert at_least("order", 2.0, 1.8, "1").passed
    missing = at_least("order", 1.5, 1.8, "1")
    assert not missing.passed
    assert missing.error == pytest.approx(0.3)  # analytic: what is missing


@pytest.mark.parametrize(
    "row",
    [
        relative("a", math.nan, 1.0, "N", 1.0),
        relative("a", 1.0, 0.0, "N", 1.0),
        absolute("a", math.nan, 0.0, "N", 1.0),
        at_most("a", math.nan, 1.0, "N"),
        at_least("a", math.nan, 1.0, "N"),
    ],
)
def test_what_was_not_measured_has_not_passed(row: Row) -> None:
    assert not row.passed


def test_json_has_exactly_the_promised_keys_in_plain_types() -> None:
    row = absolute("a", 1.0, 1.0, "N", 0.1)
    plain = json.loads(json.dumps(msgspec.to_builtins(row)))
    assert list(plain) == KEYS
    assert plain["passed"] is True


def test_rows_are_told_one_by_one_in_the_order_in_which_they_are_returned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = [absolute(name, 1.0, 1.0, "N", 0.1) for name in "abc"]
    monkeypatch.setattr(validation, "_rows", lambda: iter(made))
    told: list[Row] = []
    assert run_validation(told.append) == made == told
    assert run_validation() == made
