"""Which gains to try next: the tree-structured Parzen estimator of optuna."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mobman.benchmark.tuning.search_range import Space
from mobman.errors import MobmanError

if TYPE_CHECKING:
    import optuna

BATCH = 4
"""Trials that are proposed at once; whatever the number of workers, on which nothing may depend."""
_STARTUP = 10
"""Trials at random before the estimator has its say."""
_SEED = 0


def require_extra() -> None:
    """Raises MobmanError, with the remedy, if what only tuning needs is not installed."""
    try:
        import optuna  # noqa: F401
        import tomli_w  # noqa: F401
    except ImportError as error:
        raise MobmanError(
            f"tuning needs {error.name}, which is not installed; install it with: "
            "pip install 'mobman[tune]'"
        ) from error


def sampler_settings() -> dict[str, Any]:
    """What the proposals depend on beside the trials, for records."""
    import optuna

    return {
        "sampler": "TPE",
        "optuna": optuna.__version__,
        "multivariate": True,
        "startup_trials": _STARTUP,
        "batch": BATCH,
        "seed": _SEED,
    }


def propose(
    space: Space, tried: Sequence[tuple[Mapping[str, float], float]], batch: int, count: int
) -> list[dict[str, float]]:
    """The gains of a batch; the same for the same trials, in whatever process.

    Args:
        space: Ranges by gain.
        tried: Gains and scores of all trials before the batch.
        batch: The batch's number, from which its randomness comes.
        count: How many.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    seed = int(np.random.SeedSequence([_SEED, batch]).generate_state(1)[0])
    sampler = optuna.samplers.TPESampler(
        seed=seed, n_startup_trials=_STARTUP, multivariate=True, constant_liar=True
    )
    study = optuna.create_study(sampler=sampler, direction="minimize")
    distributions = _distributions(space)
    study.add_trials(
        [
            optuna.trial.create_trial(params=dict(gains), distributions=distributions, value=value)
            for gains, value in tried
        ]
    )
    asked = [study.ask(distributions) for _ in range(count)]
    return [{name: space[name].rounded(trial.params[name]) for name in space} for trial in asked]


def _distributions(space: Space) -> dict[str, optuna.distributions.BaseDistribution]:
    import optuna

    return {
        name: optuna.distributions.FloatDistribution(own.low, own.high, log=own.log)
        for name, own in space.items()
    }
