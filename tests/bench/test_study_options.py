"""Options that several commands share."""

from dataclasses import fields

import typer

from bench.cli import app
from bench.studies import Options
from bench.study_options import StudyOptions

COMMANDS = typer.main.get_command(app).commands


def test_run_and_plan_take_the_same_options_for_a_study():
    names = {field.name for field in fields(StudyOptions)}
    run, plan = (
        {one.name: (one.opts, getattr(one, "help", "")) for one in COMMANDS[command].params}
        for command in ("run", "plan")
    )
    assert names <= set(run)
    assert {name: run[name] for name in names} == {name: plan[name] for name in names}


def test_a_command_takes_every_option_that_a_study_has():
    assert {field.name for field in fields(StudyOptions)} == {"preset", *Options.__annotations__}
