"""The filter study: what it needs, what it compares, and its table."""

from collections.abc import Sequence

import pytest

from dualbend.errors import InputError
from dualbend.scenario.load import load_scenario
from dualbend.scenario.scenario import Scenario
from dualbend.study.onset.held import Oscillation
from filters import filters as module
from filters.filters import FILTERS, filters_compared, table
from support.strip import STRIP9

FIG9 = load_scenario(STRIP9)


def test_without_a_filter_there_is_nothing_to_compare() -> None:
    with pytest.raises(InputError, match="filters: none given"):
        filters_compared(FIG9, filters=())


def test_losses_are_of_the_first_filter_s_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Analytic: a run that grows below b = 0.6 N s/mm; losses as the page has them."""

    def oscillate(scenarios: Sequence[Scenario], axis: str, *, friction: bool) -> list[Oscillation]:
        grow = [scenario.compliance.x.b < 0.6 for scenario in scenarios]  # type: ignore[union-attr]
        return [Oscillation(grows=g, growth_per_s=0.0, frequency_hz=2.0, final=0.0) for g in grow]

    monkeypatch.setattr(module, "oscillate", oscillate)
    none, short = filters_compared(FIG9, filters=FILTERS[:2])
    assert (none.predicted_loss, none.simulated_loss) == (0.0, 0.0)
    assert none.simulated_b == pytest.approx(0.6, rel=3e-3)  # a step of the grid
    assert short.simulated_loss == pytest.approx(0.0, abs=6e-3)
    # Golden, docs/stability.md: 0.5797 and 0.6400, 9.4 % lost.
    assert none.predicted_b == pytest.approx(0.5797, abs=5e-5)
    assert short.predicted_loss == pytest.approx(0.094, abs=5e-4)
    assert "| fir 10 Hz, 2 taps | 0.64 | 0." in table([none, short]).markdown()
