"""The options of commands that take a study: `bench run` and `bench plan`."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any

import typer

from bench.options import number
from bench.studies import study_of

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="METHOD.FIELD=VALUE sets a field of a method's config, such as nn.epochs=50 or"
        " ngf.hidden=64,32. Several values, such as nn.epochs=50,100, give a row each. Repeat to"
        " set several fields.",
    ),
]
Weights = Annotated[
    list[str] | None,
    typer.Option(
        "--weights",
        help="METHOD=FILE evaluates the weights in a file of `bench.save_weights` instead of"
        " training the method. With several tasks: METHOD@TASK=FILE, one for each.",
    ),
]


@dataclass(frozen=True)
class StudyOptions:
    """The name of a preset, and options that change it, see `bench.studies.Options`."""

    preset: Annotated[
        str,
        typer.Argument(
            help="Name of a preset: smoke, quick, paper, audit or beyond. See `bench describe"
            " NAME`."
        ),
    ]
    experiments: Annotated[
        str | None,
        typer.Option(
            help="Comma-separated experiments, such as success,ood; `bench describe NAME` explains"
            " one. Default: all in the preset."
        ),
    ] = None
    tasks: Annotated[
        str | None,
        typer.Option(help="Comma-separated tasks, such as door,tool. Default: all in the preset."),
    ] = None
    methods: Annotated[
        str | None,
        typer.Option(
            help="Comma-separated methods, such as kodex,nn,expert. Default: the preset's methods"
            " and the expert."
        ),
    ] = None
    sizes: Annotated[
        str | None,
        typer.Option(
            help="Comma-separated model sizes to compare, such as small,large. Default: all in the"
            " preset."
        ),
    ] = None
    variants: Annotated[
        str | None,
        typer.Option(
            help="Comma-separated method variants for the experiment variants, such as"
            " described,published. Default: all."
        ),
    ] = None
    seeds: Annotated[
        str | None,
        typer.Option(
            help="Seeds, each a repetition of the study: a count (5 means 1 to 5), a list (2,4; 7,"
            " for seed 7 alone) or ranges (1-3,7). Default: those of the preset."
        ),
    ] = None
    episodes: Annotated[
        int | None,
        number(1, "Episodes of each evaluation, such as 500 or 1e4. Default: those of the preset."),
    ] = None
    expert: Annotated[
        str | None,
        typer.Option(
            help="Which of a task's experts demonstrates: first or second, of separate"
            " trainings. Default: first; `bench describe TASK` lists them."
        ),
    ] = None
    demos: Annotated[
        list[Path] | None,
        typer.Option(
            help="File of demonstrations to learn from, written by `bench demos record`,"
            " `from-arrays` or `import`. Give one file for each task of the run. Default: the"
            " expert's demonstrations."
        ),
    ] = None
    settings: Settings = None
    weights: Weights = None


def takes_study(command: Callable[..., None]) -> Callable[..., None]:
    """Returns a command that takes `StudyOptions` in place of its first parameter, a study."""
    of_study = list(signature(StudyOptions).parameters.values())
    own = list(signature(command).parameters.values())[1:]

    @wraps(command)
    def from_options(**given: Any) -> None:
        options = {one.name: given.pop(one.name) for one in of_study}
        command(study_of(options.pop("preset"), **options), **given)

    required = [one for one in own if one.default is Parameter.empty]
    optional = [one for one in own if one.default is not Parameter.empty]
    shown = [of_study[0], *required, *of_study[1:], *optional]
    keywords = [one.replace(kind=Parameter.KEYWORD_ONLY) for one in shown]
    # What typer reads: the signature, and annotations that it can evaluate.
    vars(from_options)["__signature__"] = signature(command).replace(parameters=keywords)
    from_options.__annotations__ = {one.name: one.annotation for one in shown}
    return from_options
