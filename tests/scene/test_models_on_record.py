"""No number of a compiled model moves unseen: the shipped scenarios' models against the baseline.

Golden: fingerprints of the models, to seven digits, as `tests/baseline.json` holds them. They say
that something moved, not what; what a number means is for the other tests of this folder.
"""

from pathlib import Path

import pytest

from dualbend.check.baseline import read_baseline
from dualbend.evaluation.fingerprint import model_fingerprint
from dualbend.run.make import make_run
from dualbend.scenario.load import load_scenario

BASELINE = Path(__file__).parents[1] / "baseline.json"


@pytest.mark.parametrize("name", ["fig8", "pwb-stack", "springback"])
def test_the_compiled_model_is_the_one_on_record(name: str) -> None:
    recorded = read_baseline(BASELINE).scenarios[name].model_sha256
    assert model_fingerprint(make_run(load_scenario(name)).cell.model) == recorded
