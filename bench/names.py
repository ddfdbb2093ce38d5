"""Names of stored results, and their places in a results folder.

A results folder holds::

    study.json                  the manifest: which evaluations studies have requested
    cells/<label>-<key>/        one fit
        fit.json                its fields, times, host, versions, and SHA-256 of two files:
        weights.safetensors     its learnt parameters
        diagnostics.safetensors
        eval-<split>-<physics>-<controller>-<rule>[-<disturbance>][-<replan>].parquet
                                one row an episode
        times.json              CPU seconds of the fit and of an action, from `bench time`
    controllers/<label>-<key>/  a tracking controller: controller.json, weights.safetensors
    failures/                   one file for each failed job, with the reason
    damaged/                    files set aside: damaged, or of another version
    progress.json               the clock of a run
    .lock, .unfinished/         of the run that writes
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from tasks.data import key
from tasks.disturbances import UNDISTURBED
from tasks.masses import NOMINAL
from tasks.registry import APPENDIX, FIRST

KEY_DIGITS = 12
LONGEST = 200
"""Characters of a label in the name of a folder, which file systems limit to 255."""
CONDITIONS = ("split", "physics", "controller", "rule", "disturbance", "replan")
"""The fields that distinguish the evaluations of a fit."""
PLAIN = {"physics": NOMINAL, "rule": APPENDIX, "disturbance": UNDISTURBED, "replan": 0}
"""Those of the main comparison, in which nothing is changed."""
ADDED = ("disturbance", "replan")
"""Those that are part of names and keys only where something is changed."""
USUAL = {"weights": "", "expert": FIRST}
"""Fields of a fit that are part of keys only where they have another value."""
MANIFEST = "study.json"


class Named(Protocol):
    """Something with a readable label and a unique key."""

    @property
    def label(self) -> str:
        """A readable name, part of file names."""

    @property
    def key(self) -> str:
        """A SHA-256, 64 hexadecimal digits."""


def fit_key(version: int, fields: Mapping[str, Any]) -> str:
    """Returns the key of a fit. The config is part of it, and so its size and settings are not.

    Args:
        version: of the method; 0 for the expert.
        fields: those of `bench.spec.Fit`.
    """
    decisive = {k: v for k, v in stored_fields(fields).items() if k not in ("size", "settings")}
    return key("fit", version, decisive)


def stored_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the fields of a fit as results hold them, without those of `USUAL` that are usual."""
    return {k: v for k, v in fields.items() if k not in USUAL or v != USUAL[k]}


def controller_label(fields: Mapping[str, Any]) -> str:
    """Returns a readable name of a controller, given the fields of `bench.spec.ControllerSpec`."""
    return "{task}-{kind}-{physics}-s{seed}".format(**fields)


def folder_name(label: str, key: str) -> str:
    """Returns the name of the folder of a fit or controller. A long label is cut."""
    return f"{label[:LONGEST]}-{key[:KEY_DIGITS]}"


def evaluation_label(fit: Named, evaluation: str) -> str:
    """Returns a readable name of an evaluation of a fit, given its `evaluation_name`."""
    return f"{fit.label} {evaluation}"


def evaluation_name(conditions: Mapping[str, Any]) -> str:
    """Returns the name of an evaluation's file, without ending.

    Args:
        conditions: values of `CONDITIONS`; others are ignored.
    """
    values = [str(conditions[name]) for name in CONDITIONS if name not in ADDED]
    added = [str(conditions[n]) for n in ADDED if str(conditions[n]) != str(PLAIN[n])]
    return "-".join(("eval", *values, *added))


def cell_path(results: Path, fit: Named) -> Path:
    """Returns the folder of a fit in a results folder."""
    return results / "cells" / folder_name(fit.label, fit.key)


def evaluation_path(results: Path, fit: Named, evaluation: str) -> Path:
    """Returns the file of an evaluation, given its `evaluation_name`."""
    return cell_path(results, fit) / f"{evaluation}.parquet"


def controller_path(results: Path, controller: Named) -> Path:
    """Returns the folder of a controller in a results folder."""
    return results / "controllers" / folder_name(controller.label, controller.key)


def failure_path(results: Path, label: str) -> Path:
    """Returns the file of the failure of a job."""
    digest = hashlib.sha256(label.encode()).hexdigest()
    return results / "failures" / f"{digest[:KEY_DIGITS]}.json"
