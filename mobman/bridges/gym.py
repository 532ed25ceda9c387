"""A Gymnasium environment for any robot, task and scenario, on the plant that simulations use."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from mobman.arrays import Array
from mobman.bridges.policy import Actions, PolicyController
from mobman.errors import SingularityError, UsageError
from mobman.model.build import load_robot
from mobman.model.mobile_manipulator import MobileManipulator
from mobman.simulation.loop import Loop
from mobman.simulation.placements import Placement, placements
from mobman.simulation.scenario import Scenario, load_scenario
from mobman.simulation.simulate import seconds, whole_ticks

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    message = "the environment needs Gymnasium; install it: pip install 'mobman[gym]'"
    raise UsageError(message) from error

_HALVED = 0.1  # m, the position error that halves the reward


class TrackingEnv(gymnasium.Env[Array, Any]):
    """A tip that has to follow a task.

    Observations and actions are those of :class:`~mobman.bridges.policy.PolicyController`, by which a
    policy that was learned here is run elsewhere. The reward of a step is dt / (1 + |e_p| / 0.1 m +
    |e_o|) of the true error: an episode gives from 0 to ``duration``, and an early end costs what was
    left. ``terminated``: the run diverged or met a singularity; ``truncated``: it went to its end.
    ``reset(seed=...)`` seeds the draws of this and the following episodes, of the placement and of the
    scenario's ``seed``; ``info`` has both, ``t`` (s), the true ``task_error``, ``status`` and
    ``message``.

    >>> import gymnasium
    >>> env = gymnasium.make("mobman.bridges.gym:mobman/Tracking-v0", robot="youbot", task="paper")
    >>> observation, info = env.reset(seed=1)
    >>> env.unwrapped.names[:3], env.action_space.shape
    (['e/x', 'e/y', 'e/z'], (5,))

    Args:
        robot: By name, TOML file or object; so is the scenario.
        task: By name; ``task_options`` are its parameters.
        actions: ``"acceleration"`` or ``"torque"``, each held for ``dt`` (s).
        duration: Of an episode (s).
        numbers: Of the placements to draw from (:func:`mobman.simulation.placements.placements`); 0 is
            rest. Suites report 0 to 4 by default; tuning uses those from 1000 on.
        render_mode: None: :func:`mobman.view` shows records.

    Attributes ``names`` are those of an observation's entries, ``loop`` is the run of this episode.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        robot: MobileManipulator | str = "youbot",
        task: str = "circle",
        scenario: Scenario | str = "nominal",
        *,
        actions: Actions = "acceleration",
        duration: float = 10.0,
        dt: float = 0.01,
        task_options: dict[str, Any] | None = None,
        numbers: Iterable[int] = (0,),
        render_mode: None = None,
    ) -> None:
        if render_mode is not None:
            message = f"render_mode = {render_mode!r}: allowed: None; mobman.view shows records"
            raise UsageError(message)
        self.render_mode = render_mode
        self._robot = robot if isinstance(robot, MobileManipulator) else load_robot(robot)
        self._scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self._task, self._options = task, task_options
        try:
            given = list(numbers)
            self._numbers = [operator.index(number) for number in given]
        except TypeError:
            given = self._numbers = []
        if any(isinstance(number, bool) for number in given) or min(self._numbers, default=-1) < 0:
            raise UsageError(f"numbers = {numbers!r}: expected a list of whole numbers from 0 on")
        self._dt = seconds("dt", dt)
        self._ticks = whole_ticks(seconds("duration", duration), self._dt)
        self._placed: dict[int, Placement] = {}
        self._law = law = PolicyController(lambda _: self._action, actions)
        law.reset(self._robot, self._place(self._numbers[0]).task, self._dt)
        self.names = law.names
        self.action_space = spaces.Box(-1.0, 1.0, (self._robot.nz,), np.float32)
        # errors of 1e-9 m are nothing in single precision
        self.observation_space = spaces.Box(law.low, law.high, dtype=np.float64)
        self._ahead: Iterator[tuple[Array, Array, Array]] = iter(())
        self._seen, self._action, self._number, self._tick = law.low, np.zeros(0), 0, -1

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode; see the class. UsageError if the scenario does not fit the robot."""
        super().reset(seed=seed)
        self._number = int(self.np_random.choice(self._numbers))
        placed, self._seed = self._place(self._number), int(self.np_random.integers(2**31))
        start = self._scenario.start_of(self._robot, placed.q0)
        parts = (self._robot, self._law, placed.task, self._scenario)
        self.loop = Loop(*parts, q0=start, ticks=self._ticks, dt=self._dt, seed=self._seed)
        self._ahead, self._tick = self.loop.ticks_ahead(), -1
        if self._go_on():
            raise UsageError(f"the episode cannot start: {self.loop.samples.message}")
        return self._seen, self._info()

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold an action for ``dt``; see the class. UsageError if it is no such vector."""
        if not 0 <= self._tick < self._ticks:
            raise UsageError("no episode is under way; call reset first")
        self._action = self._law.checked(action)  # a refused one does not end the episode
        terminated = self._go_on()
        info, over = self._info(), self._tick == self._ticks
        e = info["task_error"]
        reward = self._dt / (1.0 + np.linalg.norm(e[:3]) / _HALVED + np.linalg.norm(e[3:]))
        if terminated:
            self._tick, self._seen = -1, self._seen.copy()
        return self._seen, 0.0 if terminated else float(reward), terminated, over, info

    def _place(self, number: int) -> Placement:
        if number not in self._placed:
            self._placed |= placements(self._robot, [number], self._task, self._options)
        return self._placed[number]

    def _go_on(self) -> bool:
        """Go to the next tick and observe it; True if the run ends before."""
        try:
            with np.errstate(all="ignore"):
                q, z, _ = next(self._ahead)
            self._seen = self._law.observe((self._tick + 1) * self._dt, q, z)
        except StopIteration:
            return True
        except SingularityError as error:
            self.loop.samples.status, self.loop.samples.message = "singular", str(error)
            return True
        self._tick += 1
        return False

    def _info(self) -> dict[str, Any]:
        samples, row = self.loop.samples, max(self._tick, 0)
        error = samples.tip_position[row] - samples.tip_desired[row]
        error = np.append(error, samples.orientation_error[row])
        found = {"t": row * self._dt, "placement": self._number, "seed": self._seed}
        return {**found, "task_error": error, "status": samples.status, "message": samples.message}


gymnasium.register(id="mobman/Tracking-v0", entry_point=f"{__name__}:TrackingEnv")
