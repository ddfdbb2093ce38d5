"""Write exhibits: tables as CSV, Markdown and LaTeX, figures as PNG, PDF and SVG."""

from pathlib import Path
from types import ModuleType

import pandas as pd

from reports import table_1
from reports.style import style

EXHIBITS: tuple[ModuleType, ...] = (table_1,)
"""Each has NAME, TITLE, table(frame), figure(table), caption(table)."""

_DATED = {"png": (), "pdf": ("CreationDate",), "svg": ("Date",)}
"""File endings of figures, and what each would say of the time: it must not."""


def write_report(frame: pd.DataFrame, folder: Path) -> list[Path]:
    """Writes every exhibit that the stored evaluations have rows for; returns the tables' paths.

    Args:
        frame: stored evaluations, as `bench.store.Store.frame` gives them.
        folder: gets ``tables/`` and ``figures/``.
    """
    written = []
    for exhibit in EXHIBITS:
        table = exhibit.table(frame)
        if len(table):
            _write_figure(exhibit, table, folder / "figures")
            written.append(_write_table(exhibit, table, folder / "tables"))
    return written


def _write_table(exhibit: ModuleType, table: pd.DataFrame, folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    caption = exhibit.caption(table)
    table.to_csv(folder / f"{exhibit.NAME}.csv", index=False)
    markdown = table.to_markdown(index=False, floatfmt=".1f")
    path = folder / f"{exhibit.NAME}.md"
    path.write_text(f"## {exhibit.TITLE}\n\n{markdown}\n\n{caption}\n")
    latex = table.style.hide(axis="index").format(precision=1, escape="latex")
    latex.format_index(escape="latex", axis="columns")
    (folder / f"{exhibit.NAME}.tex").write_text(
        latex.to_latex(hrules=True, position_float="centering", label=exhibit.NAME, caption=caption)
    )
    return path


def _write_figure(exhibit: ModuleType, table: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        figure = exhibit.figure(table)
        for ending, dated in _DATED.items():
            figure.savefig(folder / f"{exhibit.NAME}.{ending}", metadata=dict.fromkeys(dated))
