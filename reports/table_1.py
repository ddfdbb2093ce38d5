"""Table 1: success of KODex from the starts of the validation demonstrations."""

import pandas as pd
from matplotlib.figure import Figure

from reports.paper import published
from reports.stats import wilson
from reports.style import PUBLISHED, TASK_NAMES, colour

NAME = "table_1"
TITLE = "Table 1: success of KODex on the validation starts"


def table(frame: pd.DataFrame) -> pd.DataFrame:
    """Returns one row a task: success and its 95% Wilson interval [%], n, and the paper's value.

    Args:
        frame: stored evaluations, as `bench.store.Store.frame` gives them.
    """
    chosen = frame[
        (frame.method == "kodex")
        & (frame.variant == "described")
        & (frame.split == "validation")
        & (frame.physics == "nominal")
    ].set_index("task")
    paper = published(NAME).set_index("column").value
    rows = []
    for task in [name for name in TASK_NAMES if name in chosen.index]:
        found = chosen.loc[task]
        low, high = wilson(found.successes, found.episodes)
        rows.append(
            {
                "task": TASK_NAMES[task],
                "success [%]": 100 * found.successes / found.episodes,
                "low [%]": 100 * low,
                "high [%]": 100 * high,
                "n": found.episodes,
                "diverged": found.diverged,
                "published [%]": paper[task],
            }
        )
    return pd.DataFrame(rows)


def figure(table: pd.DataFrame) -> Figure:
    """Returns bars with intervals, and the paper's values as diamonds."""
    drawing = Figure(figsize=(5, 3.2))
    axes = drawing.subplots()
    x = range(len(table))
    height = table["success [%]"]
    error = [height - table["low [%]"], table["high [%]"] - height]
    axes.bar(x, height, 0.6, yerr=error, capsize=4, color=colour("kodex"), label="this suite")
    axes.plot(x, table["published [%]"], "D", color=PUBLISHED, mec="white", label="published")
    axes.set_xticks(x, table.task)
    axes.set(ylabel="success [%]", ylim=(0, 105), title="KODex, validation starts")
    axes.grid(axis="x", visible=False)
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1, 1))
    return drawing


def caption(table: pd.DataFrame) -> str:
    """Returns what a reader must know to read table and figure."""
    counts = ", ".join(str(n) for n in sorted(set(table.n)))
    return (
        f"Success of KODex from the starts of the validation demonstrations, n = {counts} episodes"
        " a task, one fit; intervals are 95% Wilson. Published: Table 1 of the appendix, n = 50."
    )
