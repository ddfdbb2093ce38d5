"""`methods.checks` names the rule that a broken sampler or replanning method breaks."""

import re
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import torch

from bench.checking import ANOTHER_PROCESS
from methods.base import ActionMethod, NotFittedError
from methods.checks import RULES, check
from methods.nearest import Nearest
from tasks.data import generator

PAGE = Path(__file__).parents[2] / "docs/add_a_method.md"


@dataclass(frozen=True)
class Config:
    pass


class Sampler(ActionMethod):
    """Linear feedback and noise, which each episode draws from its own generator."""

    name = "sampler"
    summary = "noisy linear feedback"
    sizes = {"single": Config()}  # noqa: RUF012
    default_size = {}  # noqa: RUF012
    _learnt = None

    def fit(self, demos, validation, seed):
        x = demos.states[:, :-1].reshape(-1, self.layout.state_dim)
        u = demos.actions.reshape(len(x), -1)
        gain = np.linalg.solve(x.T @ x + 1e-3 * np.eye(x.shape[1]), x.T @ u)
        self._learnt = {"gain": gain, "spread": np.array(0.05)}

    def parameters(self):
        return self.learnt()

    def learnt(self):
        if self._learnt is None:
            raise NotFittedError("call fit or load")
        return self._learnt

    def load(self, parameters):
        self._learnt = dict(parameters)

    def reset(self, starts, rngs):
        self._rngs = rngs

    def act(self, state, t):
        return np.clip(self.draw(state), -1, 1)

    def draw(self, state):
        gain, spread = self.learnt()["gain"], self.learnt()["spread"]
        return np.einsum("bd,da->ba", state, gain) + spread * self.noise()

    def noise(self):
        return np.stack([rng.standard_normal(self.layout.action_dim) for rng in self._rngs])


class Chunks(Sampler):
    """Holds each action for nine steps."""

    _waiting = ()

    def reset(self, starts, rngs):
        super().reset(starts, rngs)
        self._waiting = []

    def act(self, state, t):
        self._waiting = self._waiting or [super().act(state, t)] * 9
        return self._waiting.pop()


@pytest.mark.parametrize("method", [Sampler, Chunks, Nearest])
def test_the_methods_that_are_broken_here_keep_every_rule_before(method):
    assert [result for result in check(method) if not result.passed] == []


class DrawsFromNumpy(Sampler):
    def noise(self):
        return np.random.standard_normal((len(self._rngs), 1))  # noqa: NPY002


class DrawsFromTorch(Sampler):
    def noise(self):
        return torch.randn(len(self._rngs), 1).numpy()


class DrawsFromTheSystem(Sampler):
    def reset(self, starts, rngs):
        super().reset(starts, [np.random.default_rng() for _ in rngs])


class DrawsForAllFromTheFirst(Sampler):
    def noise(self):
        return self._rngs[0].standard_normal((len(self._rngs), 1))


class DrawsByPlaceInTheBatch(Sampler):
    def reset(self, starts, rngs):
        super().reset(starts, [generator("place", place) for place in range(len(rngs))])


class KeepsItsFirstGenerators(Sampler):
    _rngs = None

    def reset(self, starts, rngs):
        super().reset(starts, self._rngs or rngs)


class KeepsItsChunk(Chunks):
    """A check's episode has eleven whole chunks, so only one that is broken off leaves a rest."""

    def reset(self, starts, rngs):
        self._rngs = rngs


class DrawsAnewForAllWhenOneStops(Chunks):
    _before = None

    def act(self, state, t):
        if t and (state == self._before).all(axis=1).any():
            self._waiting = []
        self._before = state
        return super().act(state, t)


class LosesItsSpread(Sampler):
    def parameters(self):
        return {"gain": super().parameters()["gain"]}

    def load(self, parameters):
        super().load(parameters | {"spread": np.array(0.1)})


class SubtractsInPlace(Sampler):
    def act(self, state, t):
        if t:
            self._before -= state
        self._before = state
        return super().act(state.copy(), t)


class NeedsCompany(Sampler):
    def act(self, state, t):
        return super().act(state, t).squeeze()


class ActsBeyondTheRange(Sampler):
    def act(self, state, t):
        return self.draw(state)


class ActsWithinTheDemonstratedPlaces(Sampler):
    """Objects of demonstrations are at most 0.3 m away."""

    def act(self, state, t):
        with np.errstate(invalid="ignore"):
            return super().act(state, t) * np.sqrt(1 - state[:, -1:])


class SaysThatItReplans(Sampler):
    replans = True


class PlansFromItsFirstState(Nearest):
    _first = None

    def rollout(self, start, steps):
        self._first = start if self._first is None else self._first
        motion = super().rollout(self._first, steps)
        motion[:, 0] = start
        return motion


class CountsItsPlans(Nearest):
    asked = 0

    def rollout(self, start, steps):
        motion = super().rollout(start, steps + self.asked)
        self.asked += 1
        return np.concatenate([start[:, None], motion[:, self.asked :]], axis=1)


class SharesAClock(Nearest):
    def _nearest(self, start):
        length = self._fitted().shape[1]
        which, when = np.divmod(super()._nearest(start), length)
        return which * length + int(when.mean())


class EndsWithItsDemonstration(Nearest):
    def rollout(self, start, steps):
        length = self._fitted().shape[1]
        left = length - 1 - (self._nearest(start) % length).max()
        return super().rollout(start, min(steps, left))


class BeginsAtADemonstration(Nearest):
    """Hands of demonstrations all start alike, so only states on the way differ."""

    def rollout(self, start, steps):
        motions = self._fitted()
        motion = super().rollout(start, steps)
        motion[:, 0] = motions.reshape(-1, motions.shape[-1])[self._nearest(start)]
        return motion[:, :, : self.layout.robot_dim]


def starting_over():
    """Method of the template, which knows starts only, said to replan."""
    written = {}
    code = (files("methods.template") / "NAME.py.txt").read_text()
    exec(code.replace("{{name}}", "knn").replace("{{Class}}", "Knn"), written)
    written["Knn"].replans = True
    return written["Knn"]


def broken_rules(method):
    """Returns the message of each rule that is broken, without those that could not be tried."""
    return {one.rule: one.message for one in check(method) if one.tried and not one.passed}


AGAIN = "it answers differently when it is asked again: "
CHANCE = "it may draw random numbers from the rngs of reset alone"
ALONE = "answers alone and together are"


@pytest.mark.parametrize(
    ("method", "rule", "message"),
    [
        (DrawsFromTheSystem, "same_start_same_answer", CHANCE),
        (DrawsForAllFromTheFirst, "batch_invariance", ALONE),
        (DrawsByPlaceInTheBatch, "batch_invariance", ALONE),
        (KeepsItsFirstGenerators, "same_start_same_answer", f"{AGAIN}reset must forget"),
        (KeepsItsChunk, "same_start_same_answer", f"{AGAIN}reset must forget"),
        (DrawsAnewForAllWhenOneStops, "ended_episodes_ignored", "when other episodes have ended"),
        (LosesItsSpread, "survives_storage", "once stored and loaded"),
        (SubtractsInPlace, "states_untouched", "wrote to the states that it was given"),
        (NeedsCompany, "batch_invariance", "act returned shape (28,), expected (1, 28)"),
        (ActsBeyondTheRange, "actions_in_range", "off the demonstrations: clip actions to [-1, 1]"),
        (ActsWithinTheDemonstratedPlaces, "actions_in_range", "returned NaN or inf in a state off"),
        (SaysThatItReplans, "replans_from_any_state", "but it predicts no motions"),
        (PlansFromItsFirstState, "same_start_same_answer", f"{AGAIN}rollout must keep nothing"),
        (CountsItsPlans, "same_start_same_answer", f"{AGAIN}rollout must keep nothing"),
        (SharesAClock, "replans_alone_or_together", "apart alone and together"),
        (EndsWithItsDemonstration, "replans_from_any_state", "expected (6, 100, 35)"),
        (BeginsAtADemonstration, "replans_from_any_state", "does not begin there"),
        (starting_over(), "replans_onward", "it must go on from the state that it is given"),
    ],
)
def test_each_fault_of_a_sampler_or_replanner_breaks_its_rule(method, rule, message):
    broken = broken_rules(method)
    assert message in broken[rule]
    assert set(broken) == {rule}


@pytest.mark.parametrize(
    ("method", "library"), [(DrawsFromNumpy, "NumPy"), (DrawsFromTorch, "torch")]
)
def test_a_sampler_that_draws_from_a_global_stream_is_told_which(method, library):
    broken = broken_rules(method)
    assert broken["process_untouched"] == f"it changed the global random stream of {library}"
    assert CHANCE in broken["same_start_same_answer"]
    assert len(broken) == 2


def test_the_tutorial_names_rules_that_exist():
    named = re.findall(r"^\| .* \| `(\w+)` \|$", PAGE.read_text(), re.M)
    assert len(named) > 10
    assert set(named) <= {*RULES, ANOTHER_PROCESS}
