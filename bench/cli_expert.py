"""`bench expert`: train and evaluate the experts that demonstrate the tasks."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from bench.doing import doing
from bench.guest_tasks import known_task
from bench.options import AsJson, TaskName, number
from bench.parsing import seeds as parse_seeds
from tasks.errors import unknown_name
from tasks.files import writable_folder
from tasks.registry import FIRST
from tasks.words import count_of

Which = Annotated[str, typer.Option(help="Which of a task's experts: first or second.")]

app = typer.Typer(
    no_args_is_help=True,
    help="Train and evaluate experts, the policies that demonstrate the tasks.",
)


@app.command()
def train(
    task: TaskName,
    seed: Annotated[
        int, number(1, "Seed of weights, starts and noise. The same seed gives the same expert.")
    ] = 1,
    folder: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the training run. Default: experts/TASK-SEED in the cache (BENCH_CACHE,"
            " else ~/.cache/kodex-bench)."
        ),
    ] = None,
    threads: Annotated[int, number(1, "Threads of the simulator.")] = 2,
) -> None:
    """Train an expert by reinforcement learning. Rerun the same command to resume."""
    from bench.probe import complete_card
    from tasks.cache import writable_cache
    from tasks.expert_training import train as train_expert
    from tasks.expert_training import write_expert
    from tasks.recipes import recipe_of

    chosen = known_task(task)
    steps = recipe_of(chosen).steps
    folder = writable_folder(folder) if folder else writable_cache(f"experts/{task}-{seed}")
    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Progress(*columns) as progress:
        bar = progress.add_task(task, total=steps)

        def report(row: dict[str, float]) -> None:
            shown = "{steps:,} steps, success {success:.0%}, reward {reward:.2f}".format(**row)
            progress.update(bar, completed=row["steps"], description=f"{task}: {shown}")
            if not progress.console.is_terminal:
                print(f"{task}: {shown}, {row['seconds']:.0f} s", flush=True)

        train_expert(chosen, folder, report, seed, threads)
    with doing(f"evaluating the expert of {task}"):
        card = write_expert(chosen, folder)
        faults = complete_card(chosen, card)
    print(f"wrote {card}: {'; '.join(faults) or 'fit to demonstrate'}")


@app.command()
def evaluate(
    task: TaskName,
    expert: Which = FIRST,
    episodes: Annotated[int, number(1, "Episodes, from the first starts of the split.")] = 1000,
    split: Annotated[
        str, typer.Option(help="Set of starts: train, demo, probe, test or ood.")
    ] = "probe",
    physics: Annotated[
        str,
        typer.Option(help="nominal, or a variation such as heavy_hand; see `bench describe TASK`."),
    ] = "nominal",
    as_json: AsJson = False,
) -> None:
    """Measure how often a shipped expert succeeds, without action noise."""
    from bench.intervals import wilson
    from tasks.experts import evaluate as evaluate_expert
    from tasks.experts import load_expert

    chosen = known_task(task)
    policy = load_expert(chosen, expert).policy
    with doing(f"evaluating the {expert} expert of {task} in {count_of(episodes, 'episode')}"):
        counts = evaluate_expert(chosen, policy, split, episodes, physics)
    low, high = wilson(counts["successes"], episodes)
    result: dict[str, Any] = {
        "task": task,
        "expert": expert,
        "split": split,
        "physics": physics,
        "episodes": episodes,
        "successes": counts["successes"],
        "success_rate": counts["successes"] / episodes,
        "low": low,
        "high": high,
        "diverged": counts["diverged"],
    }
    if as_json:
        print(json.dumps(result))
        return
    print(
        "{task}/{split}, {expert} expert, physics {physics}: {successes} of {tried} successful,"
        " {success_rate:.1%} [{low:.1%}, {high:.1%}] (95% Wilson); {diverged} diverged".format(
            **result, tried=count_of(episodes, "episode")
        )
    )


@app.command()
def probe(
    task: TaskName,
    expert: Which = FIRST,
    episodes: Annotated[
        int, number(1, "Episodes of KODex, from the first starts of the split probe.")
    ] = 1000,
    seeds: Annotated[
        str, typer.Option(help="Seeds of demonstrations and controllers, such as 5 (1 to 5).")
    ] = "5",
) -> None:
    """Measure how well an expert's demonstrations can be imitated. Prints a JSON object."""
    from bench.controller import ControllerConfig
    from bench.probe import probe as probe_expert
    from tasks.experts import load_expert

    chosen = known_task(task)
    policy = load_expert(chosen, expert).policy
    with doing(f"probing the {expert} expert of {task}"):
        found = probe_expert(chosen, policy, episodes, ControllerConfig(), parse_seeds(seeds))
    print(json.dumps(found, indent=2))


@app.command()
def track(
    task: TaskName,
    physics: Annotated[
        str,
        typer.Argument(
            help="nominal, or a variation such as heavy_hand; see `bench describe TASK`."
        ),
    ],
    episodes: Annotated[
        int, number(1, "Episodes of each seed, from its first starts of the split test.")
    ] = 200,
    seeds: Annotated[
        str, typer.Option(help="Seeds of the controllers, such as 5 (1 to 5) or 2,4.")
    ] = "1",
    expert: Which = FIRST,
) -> None:
    """Measure the tracking controllers of some seeds on the expert's own motions.

    A perfect imitation would give these motions. Prints a JSON list.
    """
    from bench.controller import ControllerConfig
    from bench.tracking import track as track_expert

    chosen = known_task(task)
    if physics not in chosen.physics:
        raise unknown_name("physics", physics, chosen.physics)
    with doing(f"tracking the motions of the {expert} expert of {task}"):
        found = track_expert(
            chosen, physics, episodes, ControllerConfig(), parse_seeds(seeds), expert
        )
    print(json.dumps(found, indent=2))
