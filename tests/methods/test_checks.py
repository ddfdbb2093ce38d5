"""`methods.checks` passes the suite's methods and names the rule that a broken method breaks."""

import os
import random
import sys
from dataclasses import dataclass, field, replace
from importlib.resources import files

import numpy as np
import pytest
import torch

from methods.base import ActionMethod, MotionMethod, NotFittedError
from methods.checks import DECLARED, RULES, VARIANT_RULES, check, check_variant
from methods.kodex import Kodex
from methods.ngf import NGF
from methods.ngf_published import PublishedNGF
from methods.registry import SUITE, get_method
from methods.subject import subjects
from methods.toy import HORIZON, LAYOUT
from tasks.registry import TASKS, get_task
from tasks.rule_results import RuleBrokenError

TEMPLATE = files("methods.template") / "NAME.py.txt"


SUBJECTS = {(name, one.variant): one for name in SUITE for one in subjects(get_method(name))}


@pytest.mark.parametrize("subject", SUBJECTS.values(), ids=map("-".join, SUBJECTS))
def test_every_variant_of_a_built_in_method_keeps_every_rule(subject):
    results = list(check_variant(subject))
    assert [result for result in results if not result.passed] == []
    assert [result.rule for result in results] == list(VARIANT_RULES)


@pytest.mark.parametrize("name", SUITE)
def test_the_classes_of_built_in_methods_are_declared_as_the_contract_asks(name):
    RULES[DECLARED](get_method(name))


def test_a_variant_with_a_network_of_its_own_is_checked_as_that_network():
    published = {subject.variant: subject.method for subject in subjects(get_method("ngf"))}
    assert published == {"described": NGF, "published": PublishedNGF}


def test_the_synthetic_demonstrations_are_as_long_as_those_of_any_task():
    tasks = [get_task(name) for name in TASKS]
    assert max(task.horizon for task in tasks) == HORIZON
    assert get_task("door").layout == LAYOUT


@dataclass(frozen=True)
class Config:
    gain: float = 1.0


class Steering(ActionMethod):
    """A sound action method: ridge regression from states to actions."""

    name = "steering"
    summary = "linear feedback"
    sizes = {"single": Config()}  # noqa: RUF012
    default_size = {}  # noqa: RUF012
    _gain = None

    def fit(self, demos, validation, seed):
        x = demos.states[:, :-1].reshape(-1, demos.states.shape[-1])
        u = demos.actions.reshape(len(x), -1)
        self._gain = np.linalg.solve(x.T @ x + 1e-3 * np.eye(x.shape[1]), x.T @ u)

    def parameters(self):
        if self._gain is None:
            raise NotFittedError("call fit or load")
        return {"gain": self._gain}

    def load(self, parameters):
        self._gain = parameters["gain"]

    def reset(self, starts, rngs):
        pass

    def act(self, state, t):
        # Row by row, so that no sum depends on the number of rows.
        return np.clip(np.einsum("bd,da->ba", state, self.parameters()["gain"]), -1, 1)


def test_a_sound_action_method_keeps_every_rule():
    assert [result for result in check(Steering) if not result.passed] == []


class OneVariant(Kodex):
    """KODex without the variants that a broken method would break too, and with few observables."""

    sizes = {"single": replace(Kodex.sizes["single"], observables=1)}  # noqa: RUF012
    variants = {"described": {}}  # noqa: RUF012


class Seeded(OneVariant):
    """KODex whose fit depends on the seed."""

    def fit(self, demos, validation, seed):
        super().fit(demos, validation, seed)
        self._koopman[0] *= 1 + 0.01 * seed


def test_a_method_that_depends_on_the_seed_keeps_every_rule():
    assert [result for result in check(Seeded) if not result.passed] == []


class Motions(OneVariant):
    """KODex whose motions a subclass can spoil."""

    def spoil(self, motion):
        return motion

    def rollout(self, start, steps):
        return self.spoil(super().rollout(start, steps))


class WrongShape(Motions):
    def spoil(self, motion):
        return motion[:, 1:]


class SinglePrecisionList(Motions):
    def spoil(self, motion):
        return motion.tolist()


class NotANumber(Motions):
    def spoil(self, motion):
        motion[:, -1, 0] = np.nan
        return motion


class MovedStart(Motions):
    def spoil(self, motion):
        return motion + 1e-6


class BatchDependent(Motions):
    def spoil(self, motion):
        motion[:, 1:] += motion[:, 1:].mean(axis=0) / len(motion)
        return motion


class Still(Motions):
    def spoil(self, motion):
        return np.repeat(motion[:, :1], motion.shape[1], axis=1)


class Nondeterministic(OneVariant):
    def fit(self, demos, validation, seed):
        super().fit(demos, validation, seed)
        self._koopman += 1e-9 * np.random.default_rng().standard_normal(self._koopman.shape)


class FirstSeedForAll(Seeded):
    @classmethod
    def fit_seeds(cls, config, layout, demos, validation, seeds):
        return super().fit_seeds(config, layout, demos, validation, [seeds[0]] * len(seeds))


class FirstDemosForAll(OneVariant):
    @classmethod
    def fit_seeds(cls, config, layout, demos, validation, seeds):
        return super().fit_seeds(config, layout, [demos[0]] * len(seeds), validation, seeds)


class GlobalStream(OneVariant):
    def fit(self, demos, validation, seed):
        super().fit(demos, validation, seed)
        self._koopman += 1e-9 * torch.randn(1).item()


class SeedsGlobally(OneVariant):
    def fit(self, demos, validation, seed):
        random.seed(seed)
        super().fit(demos, validation, seed)


class WritesToItsInput(OneVariant):
    def fit(self, demos, validation, seed):
        demos.states[:] /= 2
        super().fit(demos, validation, seed)


class ForgetsOnSave(OneVariant):
    def parameters(self):
        return super().parameters() | {"koopman": np.round(self.koopman, 3)}


class AnswersUnfitted(MotionMethod):
    name, summary, sizes, default_size = "hold", "holds still", {"single": Config()}, {}

    def fit(self, demos, validation, seed):
        pass

    def parameters(self):
        return {"nothing": np.zeros(1)}

    def load(self, parameters):
        pass

    def rollout(self, start, steps):
        return np.repeat(start[:, None], steps + 1, axis=1)


class WritesToStates(OneVariant):
    def rollout(self, start, steps):
        motion = super().rollout(start, steps)
        start[:] = 0
        return motion


class RaisesInFit(OneVariant):
    def fit(self, demos, validation, seed):
        raise KeyError("learning_rate")


class Exits(OneVariant):
    def fit(self, demos, validation, seed):
        sys.exit(4)


class ChangesFolder(OneVariant):
    def fit(self, demos, validation, seed):
        super().fit(demos, validation, seed)
        os.chdir("/")


class Doubles(OneVariant):
    def fit(self, demos, validation, seed):
        super().fit(demos, validation, seed)
        torch.set_default_dtype(torch.float64)


class Counts(Motions):
    asked = 0

    def spoil(self, motion):
        self.asked += 1
        motion[:, 1:] += 1e-3 * self.asked
        return motion


class LearnsNothing(OneVariant):
    def parameters(self):
        return {}


class UnstorableDiagnostics(OneVariant):
    def diagnostics(self):
        return {"kind": np.array(["text"])}


class SizeWithASlash(OneVariant):
    sizes = {"w/o": Kodex.sizes["single"]}  # noqa: RUF012


class Raises(OneVariant):
    def rollout(self, start, steps):
        super().rollout(start, steps)
        raise ZeroDivisionError("no motion today")


@pytest.mark.parametrize(
    ("method", "rule", "message"),
    [
        (
            WrongShape,
            "answers",
            "rollout returned shape (6, 99, 35), expected (6, 100, 35) or (6, 100, 28)",
        ),
        (SinglePrecisionList, "answers", "got list"),
        (NotANumber, "finite", "rollout returned NaN or inf in 6 of 6 motions, first at t=99"),
        (MovedStart, "begins_at_the_start", "away from its start"),
        (BatchDependent, "batch_invariance", "alone and together"),
        (Still, "beats_holding_still", "holding still has"),
        (Nondeterministic, "same_seed_same_answer", "answer differently"),
        (FirstSeedForAll, "seeds_alone_or_together", "apart for seed 2"),
        (FirstDemosForAll, "seeds_alone_or_together", "apart for seed 2"),
        (GlobalStream, "process_untouched", "global random stream of torch"),
        (GlobalStream, "global_streams_unused", "depend on a global random stream"),
        (SeedsGlobally, "process_untouched", "global random stream of random"),
        (WritesToItsInput, "fits", "wrote to the demonstrations"),
        (WritesToStates, "states_untouched", "wrote to the states"),
        (ForgetsOnSave, "survives_storage", "once stored and loaded"),
        (AnswersUnfitted, "unfitted_raises", "was not fitted"),
        (Raises, "answers", "ZeroDivisionError: no motion today (test_checks.py:"),
        (RaisesInFit, "fits", "fit raised KeyError: 'learning_rate' (test_checks.py:"),
        (Exits, "fits", "SystemExit: 4"),
        (ChangesFolder, "process_untouched", "it changed the current folder"),
        (Doubles, "process_untouched", "torch's default dtype"),
        (Counts, "same_start_same_answer", "when it is asked again"),
        (LearnsNothing, "fits", "parameters() is empty"),
        (UnstorableDiagnostics, "fits", "diagnostics() holds 'kind'"),
        (SizeWithASlash, "declared", "a size cannot be called 'w/o'"),
    ],
)
def test_each_fault_breaks_its_rule(method, rule, message):
    broken = {result.rule: result.message for result in check(method) if not result.passed}
    assert message in broken[rule]


class NotANumberInOneMotion(Motions):
    def spoil(self, motion):
        motion[:1, 40:] = np.nan
        return motion


class NotANumberAnywhere(Motions):
    def spoil(self, motion):
        return np.full_like(motion, np.nan)


class NotANumberLate(Steering):
    def act(self, state, t):
        return super().act(state, t) / (t != 30 or np.nan)


class RaisesForOne(OneVariant):
    """Raises the same error in every rule that asks for a single motion."""

    def rollout(self, start, steps):
        if len(start) == 1:
            raise ValueError("give me more")
        return super().rollout(start, steps)


class NeverTheSame(Nondeterministic):
    def fit(self, demos, validation, seed):
        super().fit(demos, validation, seed)
        self._koopman *= 1 + 1e-4 * np.random.default_rng().random()


@pytest.mark.parametrize(
    ("method", "rule", "untried"),
    [
        (NotANumber, "finite", 4),
        (NotANumberInOneMotion, "finite", 4),
        (NotANumberLate, "finite", 4),
        (NotANumberAnywhere, "finite", 13),
        (RaisesInFit, "fits", 17),
        (Raises, "answers", 16),
        (RaisesForOne, "batch_invariance", 2),
        (NeverTheSame, "same_seed_same_answer", 2),
        (Counts, "same_start_same_answer", 8),
    ],
)
def test_one_fault_is_reported_by_one_rule(method, rule, untried):
    results = list(check(method))
    assert [one.rule for one in results if one.tried and not one.passed] == [rule]
    assert [one.passed for one in results if not one.tried] == [False] * untried
    assert {one.message for one in results if not one.tried} <= {f"needs {rule}"}


def test_nan_at_a_late_step_of_an_action_method_is_reported_with_its_step():
    results = [one for one in check(NotANumberLate) if one.tried and not one.passed]
    broken = {one.rule: one.message for one in results}
    assert broken == {"finite": "act returned NaN or inf in 6 of 6 episodes, first at t=30"}


class RaisesTwice(OneVariant):
    """Breaks two rules with the same line."""

    def rollout(self, start, steps):
        if self._koopman is None or len(start) == 1:
            raise ValueError("no motion")
        return super().rollout(start, steps)


def test_an_error_that_breaks_two_rules_is_reported_once():
    results = {one.rule: one for one in check(RaisesTwice) if not one.passed}
    assert results["unfitted_raises"].tried
    assert not results["batch_invariance"].tried
    assert results["batch_invariance"].message == "meets the error of unfitted_raises"


@dataclass(frozen=True)
class Derived:
    """A config with a field that is computed from another."""

    gain: float = 1.0
    layers: tuple[tuple[int, ...], ...] = ((4, 2), (1,))
    double: float = field(init=False, default=0.0)

    def __post_init__(self):
        object.__setattr__(self, "double", 2 * self.gain)


class Nearest(OneVariant):
    """Stores its demonstrations, and complex numbers as diagnostics."""

    sizes = {"one": Derived(), "three": Derived(3.0)}  # noqa: RUF012
    default_size = {}  # noqa: RUF012
    replans = False
    _states = None

    def __init__(self, config, layout):
        MotionMethod.__init__(self, config, layout)

    def fit(self, demos, validation, seed):
        if len(demos) < 3:
            raise ValueError("three demonstrations are needed")
        self._states = demos.states.copy()

    def parameters(self):
        if self._states is None:
            raise NotFittedError("call fit or load")
        return {"states": self._states, "count": np.array(3)}

    def load(self, parameters):
        assert parameters["count"].shape == ()
        self._states = parameters["states"]
        self._states += 0.0  # a method may write to its parameters

    def diagnostics(self):
        return {"eigenvalues": np.linalg.eigvals(np.array([[0.0, 1.0], [-1.0, 0.0]]))}

    def rollout(self, start, steps):
        states = self.parameters()["states"]
        apart = np.linalg.norm(start[:, None] - states[:, 0], axis=-1)
        motion = states[apart.argmin(axis=1), : steps + 1].copy()
        motion[:, 0] = start
        return motion


def test_a_method_that_stores_its_demonstrations_keeps_every_rule():
    assert [result for result in check(Nearest) if not result.passed] == []


def test_sizes_of_a_method_may_store_equally_many_numbers():
    """Method of the template: more neighbours take no more memory."""
    written = {}
    code = TEMPLATE.read_text().replace("{{name}}", "knn").replace("{{Class}}", "Knn")
    exec(compile(code, "knn.py", "exec"), written)
    single = written["Knn"].sizes["single"]
    written["Knn"].sizes = {"one": single, "three": replace(single, neighbours=3)}
    assert [result for result in check(written["Knn"]) if not result.passed] == []


class BrokenVariant(Motions):
    """KODex that holds still with the second set of observables."""

    variants = {"described": {}, "set_2": {"observables": 2}}  # noqa: RUF012

    def spoil(self, motion):
        return Still.spoil(self, motion) if self.config.observables == 2 else motion


def test_a_broken_variant_is_reported_with_its_name():
    results = list(check(BrokenVariant))
    broken = [(one.variant, one.rule) for one in results if not one.passed]
    assert broken == [("set_2", "beats_holding_still")]
    assert len(results) == 1 + 2 * len(VARIANT_RULES)
    with pytest.raises(RuleBrokenError, match="variant 'set_2': its mean error is"):
        RULES["beats_holding_still"](BrokenVariant)


class UnknownField(OneVariant):
    variants = {"described": {}, "wide": {"width": 3}}  # noqa: RUF012


def test_a_variant_that_sets_an_unknown_field_breaks_the_declaration_only():
    first, *others = check(UnknownField)
    assert first.message == "variant 'wide' sets 'width', which size 'single' lacks"
    assert {one.message for one in others} == {"needs declared"}
