"""Computes, in the process of a job, a controller, fits, or an evaluation.

Each function depends only on its arguments and returns a list of results. A
method's results are bytes, see `methods.contract`.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bench.controller import Controller, train_controllers
from bench.provenance import provenance, software
from bench.remarks import who_answers
from bench.rollout import FeedbackPolicy, TrackedMotion
from bench.spec import EXPERT, Cell, ControllerSpec, Fit
from methods.base import ActionMethod, Method, MotionMethod, Parameters, fits_together
from methods.contract import ContractError, Learnt, learn, loaded, motion, stored
from methods.guard import guarded
from methods.registry import get_method
from methods.toy import answer
from tasks.data import Demos, Episodes, FloatArray, Starts, join_episodes
from tasks.disturbed import disturbed
from tasks.experts import load_expert
from tasks.files import from_bytes, to_bytes
from tasks.pins import check_mark
from tasks.registry import get_task
from tasks.simulator import CHUNK, Policy, rollout


@dataclass(frozen=True)
class Fitted:
    """The learnt parameters of a fit or a controller, as the content of files."""

    parameters: bytes
    diagnostics: bytes
    seconds: float
    """CPU seconds of this seed."""
    facts: Mapping[str, Any]
    """See `bench.provenance.provenance`."""


@dataclass(frozen=True)
class Evaluated:
    """The episodes of a cell."""

    episodes: Episodes
    software: Mapping[str, Any]
    """See `bench.provenance.software`."""


def fit_controllers(
    specs: Sequence[ControllerSpec], demos: Sequence[Demos], start: Sequence[bytes] = ()
) -> list[Fitted]:
    """Returns the weights of controllers that differ only in their seeds and physics.

    Args:
        specs: the controllers.
        demos: for each controller, what it learns from.
        start: for each controller, the stored weights that it starts from. Default: random weights.
    """
    began, first = time.process_time(), specs[0]
    check_mark(first.pins)
    seeds, weights = [spec.seed for spec in specs], [from_bytes(content) for content in start]
    trained = train_controllers(first.config, demos, first.task, seeds, weights)
    seconds = (time.process_time() - began) / len(specs)
    return [_fitted(to_bytes(one), {}, seconds) for one in trained]


def fit_methods(
    fits: Sequence[Fit], demos: Sequence[Demos], validation: Sequence[Demos]
) -> list[Fitted]:
    """Returns what is learnt by each of the fits, which differ only in their seeds.

    Args:
        fits: the fits.
        demos: for each fit, its training demonstrations.
        validation: for each fit, its validation demonstrations.
    """
    first = fits[0]
    check_mark(first.pins)
    method, layout = get_method(first.method, first.variant), get_task(first.task).layout
    # A global random stream must not depend on which seeds are fitted together.
    alone = () if fits_together(method) else (first.seed,)
    stream = (first.task, first.method, first.variant, first.size, first.demos, *alone)
    with guarded(*stream), _named(fits):
        began = time.process_time()
        learnt = learn(method, first.config, layout, demos, validation, [fit.seed for fit in fits])
        seconds = (time.process_time() - began) / len(fits)
        found = zip(learnt, map(_diagnostics, learnt, validation), strict=True)
        return [
            _fitted(one.parameters, diagnostics, seconds, first.method, first.task)
            for one, diagnostics in found
        ]


def load_weights(fit: Fit, content: bytes, validation: Demos) -> Fitted:
    """Returns given weights as the result of a fit, after the method has answered with them.

    Args:
        fit: the fit.
        content: the weights.
        validation: its validation demonstrations.

    Raises:
        ContractError: the method cannot load the weights, or answers with other dimensions than
            those of the task and its horizon.
    """
    check_mark(fit.pins)
    method, layout = get_method(fit.method, fit.variant), get_task(fit.task).layout
    with guarded("weights", fit.label), _named([fit]):
        learnt = stored(loaded(method, fit.config, layout, content), fit.config, layout)
        answer(learnt.method, validation)
        return _fitted(content, _diagnostics(learnt, validation), 0.0, fit.method, fit.task)


def _diagnostics(learnt: Learnt, validation: Demos) -> Parameters:
    diagnostics = from_bytes(learnt.diagnostics)
    if isinstance(learnt.method, MotionMethod):
        diagnostics["imitation_error"] = imitation_error(learnt.method, validation)
    return diagnostics


def _fitted(parameters: bytes, diagnostics: Parameters, seconds: float, *names: str) -> Fitted:
    shown = to_bytes(diagnostics) if diagnostics else b""
    return Fitted(parameters, shown, seconds, provenance(seconds, *names))


def imitation_error(method: MotionMethod, validation: Demos) -> FloatArray:
    """Returns mean |predicted - demonstrated x_r| over demonstrations and t = 2..T, (H,)."""
    wanted = validation.states[:, 1:, : method.layout.robot_dim]
    predicted = motion(method, validation.states[:, 0], wanted.shape[1])
    errors = np.abs(predicted[:, 1:, : method.layout.robot_dim] - wanted)
    return errors.mean(axis=(0, 1))


def evaluate(
    cell: Cell, starts: Starts, kept: int, parameters: bytes, controller: bytes, threads: int
) -> list[Evaluated]:
    """Returns the episodes of a cell from some starts, as one result.

    The method is loaded again for each chunk of starts, so that chunks do not affect each other.

    Args:
        cell: the fit and the conditions.
        starts: starts of the episodes.
        kept: number of stored episodes before these.
        parameters: stored parameters of the method.
        controller: stored weights of the controller; empty if none is used.
        threads: simulator threads.
    """
    check_mark(cell.fit.pins)
    evaluation = cell.evaluation
    task = get_task(evaluation.task, evaluation.rule)
    parts = []
    for first in range(0, len(starts), CHUNK):
        row = kept + first
        with guarded(f"{cell.fit.label} {evaluation.name}", row), _named([cell.fit]):
            policy = make_policy(cell, parameters, controller)
            driver = disturbed(policy, evaluation.disturbance, task)
            chunk = starts[first : first + CHUNK]
            episodes = rollout(task, chunk, driver, evaluation.physics, threads=threads)
            if isinstance(policy, TrackedMotion | FeedbackPolicy):
                episodes = replace(episodes, non_finite=policy.non_finite(row))
            parts.append(episodes)
    return [Evaluated(join_episodes(parts), software(cell.fit.method, cell.fit.task))]


@contextmanager
def _named(fits: Sequence[Fit]) -> Iterator[None]:
    """Adds method, task and seeds to the error of a method that breaks its contract.

    Raises:
        ContractError: with them.
    """
    try:
        yield
    except ContractError as error:
        first, seeds = fits[0], [fit.seed for fit in fits]
        who = who_answers(first.method, first.variant, first.task, seeds)
        raise ContractError(f"{who}: {error}") from error


def make_policy(cell: Cell, parameters: bytes, controller: bytes) -> Policy:
    """Returns what drives the episodes of a cell, before anything disturbs it."""
    fit = cell.fit
    task = get_task(fit.task)
    if fit.method == EXPERT:
        return load_expert(task, fit.expert).policy
    method: Method = loaded(
        get_method(fit.method, fit.variant), fit.config, task.layout, parameters
    )
    if isinstance(method, MotionMethod):
        return TrackedMotion(method, Controller(from_bytes(controller)), cell.evaluation.replan)
    assert isinstance(method, ActionMethod)
    return FeedbackPolicy(method)
