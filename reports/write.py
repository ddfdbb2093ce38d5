"""Write exhibits: tables as CSV, Markdown and LaTeX, figures as PNG, PDF and SVG."""

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pandas as pd

from bench.doing import say
from reports.answer import answer
from reports.claims import FAILED, verdicts
from reports.exhibit import Exhibit
from reports.page import render
from reports.results import Results
from reports.style import style
from tasks.errors import described

MODULES = (
    "unseen",
    "all_tasks",
    *(f"table_{number}" for number in range(1, 7)),
    "figure_5",
    "starts",
    "success_over_time",
    "motions",
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


@dataclass(frozen=True)
class Report:
    """What a report has become."""

    written: list[Path]
    """The Markdown tables of the exhibits, in the order of the page."""
    failed: dict[str, str]
    """By title, why an exhibit or a claim could not be made."""
    answer: list[str]
    """As `reports.answer.answer` gives it."""
    page: Path


def write_report(results: Results, folder: Path, films: Path | None = None) -> Report:
    """Writes every exhibit that there are results for.

    An exhibit that fails is left out; stderr and the page say why.

    Args:
        results: of a run.
        folder: gets ``index.html``, ``tables/`` and ``figures/``.
        films: folder of `bench video`, whose films the page shows.

    Raises:
        InputError: there are no results.
    """
    known = [exhibit.with_remarks(results) for exhibit in exhibits()]
    tables, failed = _tables(results, known)
    written = []
    for exhibit in known:
        _remove(exhibit, folder)
        if exhibit.name in tables:
            say(f"writing {exhibit.title}")
            try:
                written.append(_write(exhibit, tables[exhibit.name], folder))
            except Exception as error:
                _remove(exhibit, folder)
                del tables[exhibit.name]
                failed[exhibit.title] = described(error)
    say("judging the claims of the paper")
    claims = verdicts(results)
    lost = claims[claims.ours == FAILED]
    failed |= {f"claim {name}": why for name, why in zip(lost.claim, lost.evidence, strict=True)}
    _write_claims(claims, folder / "tables")
    try:
        said = answer(results)
    except Exception as error:
        said, failed["the answer"] = [], described(error)
    figures, page = folder / "figures", folder / "index.html"
    page.write_text(render(results, tables, known, claims, figures, films, failed, said))
    for title, reason in failed.items():
        print(f"bench: left out: {title}: {reason}", file=sys.stderr)
    return Report(written, failed, said, page)


def _tables(
    results: Results, known: Iterable[Exhibit]
) -> tuple[dict[str, pd.DataFrame], dict[str, str]]:
    """By name the tables of the exhibits that have results, and by title why others failed."""
    tables, failed = {}, {}
    for exhibit in known:
        say(f"table of {exhibit.title}")
        try:
            table = exhibit.table(results)
        except Exception as error:
            failed[exhibit.title] = described(error)
        else:
            if len(table):
                tables[exhibit.name] = table
    return tables, failed


def _write(exhibit: Exhibit, table: pd.DataFrame, folder: Path) -> Path:
    path = _write_table(exhibit, table, folder / "tables")
    if exhibit.axis:
        _write_figure(exhibit, table, folder / "figures")
    return path


def _remove(exhibit: Exhibit, folder: Path) -> None:
    """Removes what an earlier report has written of an exhibit."""
    endings = {"tables": ("csv", "md", "tex"), "figures": _DATED}
    for place, names in endings.items():
        for ending in names:
            (folder / place / f"{exhibit.name}.{ending}").unlink(missing_ok=True)


def _write_claims(claims: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    claims.to_csv(folder / "claims.csv", index=False)
    lines = claims.drop(columns="claim").to_markdown(index=False)
    (folder / "claims.md").write_text(f"## Claims of the paper\n\n{lines}\n")


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
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once for all endings
        for ending, dated in _DATED.items():
            figure.savefig(folder / f"{exhibit.name}.{ending}", metadata=dict.fromkeys(dated))
