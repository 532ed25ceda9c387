"""Statistics of stored scores."""

from __future__ import annotations

import numpy as np
import pytest
from support.golden_access import statistics_of
from support.goldens import differences, plain, read_json, write_json

FILE = "statistics.json"
TOLERANCE = 1e-9
LABELS, CELLS = ["a", "b", "c", "d"], 18


def measured(inputs: dict) -> dict:
    """Every statistic of the inputs."""
    scores, solved = np.array(inputs["scores"]), np.array(inputs["solved"], dtype=bool)
    return plain(statistics_of(LABELS, scores, solved, inputs["strata"]))


@pytest.mark.parametrize("name", read_json(FILE))
def test_statistics_are_those_stored(name):
    stored = read_json(FILE)[name]
    problems = list(differences(measured(stored["inputs"]), stored["statistics"], TOLERANCE))
    assert not problems, "\n".join(problems)


def test_a_score_that_is_a_millionth_off_is_noticed():
    stored = read_json(FILE)["all finite"]
    inputs = {**stored["inputs"], "scores": np.array(stored["inputs"]["scores"]) * (1 + 1e-6)}
    assert list(differences(measured(inputs), stored["statistics"], TOLERANCE))


# Making the file ----------------------------------------------------------------------------------


def _inputs(failures: float) -> dict:
    generator = np.random.default_rng(3)
    cells = 2 * generator.normal(size=CELLS)
    shifts = np.array([0.0, 0.1, 1.0, 3.0])[:, None]
    scores = 10 ** (cells + shifts + 0.3 * generator.normal(size=(len(LABELS), CELLS)))
    scores[generator.random(scores.shape) < failures] = np.inf
    strata = [f"family {i % 3}" for i in range(CELLS)]
    return plain({"scores": scores, "solved": (scores < 10).astype(int), "strata": strata})


def make(report=print) -> None:
    """Store scores and their statistics."""
    content = {}
    for name, failures in {"all finite": 0.0, "with failures": 0.15}.items():
        inputs = _inputs(failures)
        content[name] = {"inputs": inputs, "statistics": measured(inputs)}
    write_json(FILE, content)
