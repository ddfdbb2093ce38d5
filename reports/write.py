"""Writes a report: tables as CSV, Markdown and LaTeX, figures as PNG, PDF and SVG, and the page."""

import sys
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import pandas as pd
from joblib import Parallel, delayed

from bench.cores import count_jobs
from bench.doing import say
from reports.answer import answer, to_beat
from reports.exhibit import MARK, Exhibit
from reports.exhibits import EXHIBITS
from reports.page import OPENING, render
from reports.results import Results
from reports.style import style
from reports.submitted_rows import Submitted
from reports.tables import table_of
from reports.verdicts import FAILED, verdicts
from tasks.errors import described

_DATED = {"png": (), "pdf": ("CreationDate",), "svg": ("Date",)}
"""File endings of figures, with the metadata to leave out: the date."""
_FIGURES_A_PROCESS = 8
"""Fewer figures are drawn faster here than in a process that must start for them."""
_COMMANDS = {"±": r"$\pm$", MARK: r"$^\dagger$"}
"""LaTeX commands, by sign."""


@dataclass(frozen=True)
class Report:
    """A written report."""

    written: list[Path]
    """Markdown tables of the exhibits, in the order of the page."""
    failed: dict[str, str]
    """Reasons for missing exhibits and claims, by title."""
    answer: list[str]
    """As `reports.answer.answer` returns it."""
    page: Path


def write_report(
    results: Results, folder: Path, films: Path | None = None, submitted: Submitted | None = None
) -> Report:
    """Writes every exhibit that has results, the claims and the page.

    An exhibit that raises an error is left out; stderr and the page give the reason.

    Args:
        results: of a run.
        folder: gets ``index.html``, ``tables/`` and ``figures/``.
        films: folder of `bench video`, whose films the page shows.
        submitted: rows that the page shows below those of the results.

    Raises:
        InputError: there are no results.
    """
    exhibits = [exhibit.with_remarks(results) for exhibit in EXHIBITS]
    tables, failed = _tables(results, exhibits)
    tabulated = [exhibit for exhibit in exhibits if exhibit.name in tables]
    say("drawing figures")
    reasons = _write_all(tabulated, tables, folder)
    for exhibit in exhibits:
        if exhibit.name not in tables:
            _remove(exhibit, folder)
    say("judging the claims of the paper")
    claims = verdicts(results)
    try:
        sentences = _sentences(results, tables)
    except Exception as error:
        sentences, failed["the answer"] = [], described(error)
    for exhibit, reason in zip(tabulated, reasons, strict=True):
        if reason:
            del tables[exhibit.name]
            failed[exhibit.title] = reason
    written = [folder / "tables" / f"{name}.md" for name in tables]
    undecidable = claims[claims.ours == FAILED]
    failed |= {f"claim {one.claim}": one.evidence for one in undecidable.itertuples()}
    _write_claims(claims, folder / "tables")
    submitted = submitted or Submitted()
    failed |= {f"submitted row {name}": reason for name, reason in submitted.refused.items()}
    figures, page = folder / "figures", folder / "index.html"
    shown = (films, failed, sentences, submitted.rows)
    page.write_text(render(results, tables, exhibits, claims, figures, *shown))
    for title, reason in failed.items():
        print(f"bench: left out: {title}: {reason}", file=sys.stderr)
    return Report(written, failed, sentences, page)


def _sentences(results: Results, tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """Returns the answer that the tables give; nothing if success is not among them."""
    success, beyond = (tables.get(name, table_of()) for name in OPENING)
    if success.empty:
        return []
    return [*answer(results, success), *to_beat(results, success, beyond)]


def _tables(
    results: Results, exhibits: Iterable[Exhibit]
) -> tuple[dict[str, pd.DataFrame], dict[str, str]]:
    """Returns tables by name of exhibit, and the reasons of those that failed by title."""
    tables, failed = {}, {}
    for exhibit in exhibits:
        say(f"table of {exhibit.title}")
        try:
            table = exhibit.table(results)
        except Exception as error:
            failed[exhibit.title] = described(error)
        else:
            if len(table):
                tables[exhibit.name] = table
    return tables, failed


def _write_all(
    exhibits: Sequence[Exhibit], tables: Mapping[str, pd.DataFrame], folder: Path
) -> list[str]:
    """Writes exhibits, in several processes if there are many figures.

    If a process dies, which may be for want of memory, all are written in this one.

    Returns:
        Why an exhibit could not be written, empty if it was, in the order of the exhibits.
    """
    useful = sum(bool(exhibit.axis) for exhibit in exhibits) // _FIGURES_A_PROCESS
    processes = min(count_jobs(), useful) if useful > 1 else 1
    calls = [delayed(_write)(exhibit, tables[exhibit.name], folder) for exhibit in exhibits]
    try:
        return list(Parallel(processes)(calls))
    except BrokenProcessPool:
        return list(Parallel(1)(calls))


def _write(exhibit: Exhibit, table: pd.DataFrame, folder: Path) -> str:
    """Writes an exhibit over that of an earlier report. Returns why it failed, or nothing."""
    _remove(exhibit, folder)
    try:
        _write_table(exhibit, table, folder / "tables")
        if exhibit.axis:
            _write_figure(exhibit, table, folder / "figures")
    except Exception as error:
        _remove(exhibit, folder)
        return described(error)
    return ""


def _remove(exhibit: Exhibit, folder: Path) -> None:
    """Removes the files that an earlier report wrote for an exhibit."""
    endings = {"tables": ("csv", "md", "tex"), "figures": _DATED}
    for place, names in endings.items():
        for ending in names:
            (folder / place / f"{exhibit.name}.{ending}").unlink(missing_ok=True)


def _write_claims(claims: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    claims.to_csv(folder / "claims.csv", index=False)
    lines = claims.to_markdown(index=False)
    (folder / "claims.md").write_text(f"## Claims of the paper\n\n{lines}\n")


def _write_table(exhibit: Exhibit, table: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    caption, wide = exhibit.caption(table), exhibit.wide(table)
    table.to_csv(folder / f"{exhibit.name}.csv", index=False)
    markdown = wide.to_markdown(index=False, disable_numparse=True)
    (folder / f"{exhibit.name}.md").write_text(f"## {exhibit.title}\n\n{markdown}\n\n{caption}\n")
    latex = wide.style.hide(axis="index").format(escape="latex")
    latex.format_index(escape="latex", axis="columns")
    text = latex.to_latex(
        hrules=True, position_float="centering", label=exhibit.name, caption=_escape(caption)
    )
    for sign, command in _COMMANDS.items():
        text = text.replace(sign, command)
    (folder / f"{exhibit.name}.tex").write_text(text)


def _escape(text: str) -> str:
    return text.replace("%", r"\%").replace("_", r"\_")


def _write_figure(exhibit: Exhibit, table: pd.DataFrame, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        figure = exhibit.draw(table)
        figure.draw_without_rendering()
        # All endings have this layout. An engine, even that of "none", would draw before each file.
        with mpl.rc_context({"figure.constrained_layout.use": False}):
            figure.set_layout_engine(None)
            for ending, dated in _DATED.items():
                path = folder / f"{exhibit.name}.{ending}"
                figure.savefig(path, metadata=dict.fromkeys(dated))
