"""Write exhibits: tables as CSV, Markdown and LaTeX, figures as PNG, PDF and SVG."""

from importlib import import_module
from pathlib import Path

import pandas as pd

from reports.claims import verdicts
from reports.exhibit import Exhibit
from reports.page import render
from reports.results import Results
from reports.style import style

MODULES = (
    "unseen",
    "all_tasks",
    *(f"table_{number}" for number in range(1, 7)),
    "figure_5",
    *(f"table_{number}" for number in range(7, 12)),
    "figure_6",
    "figure_6_time",
    "figure_7",
    "table_12",
    "efficiency",
    "efficiency_time",
    "audit",
    "audit_controller",
    "audit_success",
    "audit_appendix_i",
)
"""One file each, in the order of the page."""

_DATED = {"png": (), "pdf": ("CreationDate",), "svg": ("Date",)}
"""File endings of figures, and what each would say of the time: it must not."""


def exhibits() -> list[Exhibit]:
    """Returns all exhibits, in the order of the page."""
    return [import_module(f"reports.{name}").EXHIBIT for name in MODULES]


def write_report(results: Results, folder: Path, films: Path | None = None) -> list[Path]:
    """Writes every exhibit that there are results for; returns the Markdown tables' paths.

    Args:
        results: of a run.
        folder: gets ``index.html``, ``tables/`` and ``figures/``.
        films: folder of `bench video`, whose films the page shows.
    """
    made = {exhibit.name: exhibit.table(results) for exhibit in exhibits()}
    tables = {name: table for name, table in made.items() if len(table)}
    written = []
    for exhibit in exhibits():
        if exhibit.name in tables:
            written.append(_write_table(exhibit, tables[exhibit.name], folder / "tables"))
            if exhibit.axis:
                _write_figure(exhibit, tables[exhibit.name], folder / "figures")
    claims = verdicts(results)
    claims.to_csv(folder / "tables" / "claims.csv", index=False)
    lines = claims.drop(columns="claim").to_markdown(index=False)
    (folder / "tables" / "claims.md").write_text(f"## Claims of the paper\n\n{lines}\n")
    page = render(results, tables, exhibits(), claims, folder / "figures", films)
    (folder / "index.html").write_text(page)
    return written


def _write_table(exhibit: Exhibit, table: pd.DataFrame, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    caption, wide = exhibit.caption(table), exhibit.wide(table)
    table.to_csv(folder / f"{exhibit.name}.csv", index=False)
    path = folder / f"{exhibit.name}.md"
    markdown = wide.to_markdown(index=False, disable_numparse=True)
    path.write_text(f"## {exhibit.title}\n\n{markdown}\n\n{caption}\n")
    latex = wide.style.hide(axis="index").format(escape="latex")
    latex.format_index(escape="latex", axis="columns")
    text = latex.to_latex(
        hrules=True, position_float="centering", label=exhibit.name, caption=_escape(caption)
    )
    (folder / f"{exhibit.name}.tex").write_text(text.replace("±", r"$\pm$"))
    return path


def _escape(text: str) -> str:
    return text.replace("%", r"\%").replace("_", r"\_")


def _write_figure(exhibit: Exhibit, table: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        figure = exhibit.draw(table)
        for ending, dated in _DATED.items():
            figure.savefig(folder / f"{exhibit.name}.{ending}", metadata=dict.fromkeys(dated))
