"""The report as one self-contained HTML page, which needs no network."""

import base64
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from reports.answer import FIXED, HOW
from reports.claim import SIMILAR
from reports.exhibit import PARTS, Exhibit
from reports.opening import first_failures, strips, study_facts
from reports.results import Results
from reports.style import INK, ON_DARK, display
from reports.submitted_rows import SubmittedRow
from reports.tables import table_of

TEMPLATES = Path(__file__).with_name("templates")
NONCE = "kodex-bench"
"""Admits the page's own style and script. All other text is escaped, and the content policy blocks
what would slip through."""
OPENING = SUCCESS, BEYOND = "success", "beyond"
"""The exhibits that the page opens with."""
_FOLLOWS = {
    **dict.fromkeys(("#000000", "#262626", INK), "currentColor"),
    "#ffffff": "var(--paper)",
    **dict.fromkeys(("#cccccc", "#b0b0b0"), "var(--line)"),
    **{colour: f"var(--{colour[1:]})" for colour in ON_DARK},
}
"""Replacements that follow the theme of the page, for the colours of figures."""


def render(
    results: Results,
    tables: dict[str, pd.DataFrame],
    exhibits: list[Exhibit],
    claims: pd.DataFrame,
    figures: Path,
    films: Path | None = None,
    failed: Mapping[str, str] | None = None,
    answer: Sequence[str] = (),
    submitted: Sequence[SubmittedRow] = (),
) -> str:
    """Returns the page.

    Args:
        results: of a run.
        tables: by name of exhibit. Exhibits without one are listed as missing.
        exhibits: in the order of the page.
        claims: as `reports.verdicts.verdicts` returns them.
        figures: folder of the exhibits' SVG files.
        films: folder of the MP4 files of `bench video`.
        failed: reasons for missing exhibits and claims, by title.
        answer: as `reports.answer.answer` returns it.
        submitted: rows below those of the results.
    """
    shown = [exhibit for exhibit in exhibits if exhibit.name in tables]
    failed = failed or {}
    absent = (exhibit.title for exhibit in exhibits if exhibit.name not in tables)
    missing = [title for title in absent if title not in failed]
    paths = sorted(films.glob("[!.]*.mp4")) if films else []
    anchors = {path.stem: f"film-{path.stem}" for path in paths}
    first = next((exhibit for exhibit in shown if exhibit.name == SUCCESS), None)
    beyond = tables.get(BEYOND, table_of())
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True)
    return environment.get_template("page.html").render(
        title="Imitation policies on a dexterous hand",
        nonce=NONCE,
        on_dark=ON_DARK,
        notes=results.notes,
        study=study_facts(results),
        answer=answer,
        fixed=FIXED,
        how=HOW,
        success=first and strips(results, first, tables[SUCCESS], beyond, submitted),
        claims=[_claim(claim) for claim in claims.to_dict("records")],
        similar=f"{SIMILAR:g}",
        counts=", ".join(f"{count} {verdict}" for verdict, count in _counts(claims).items()),
        parts={
            part: [_shown(one, tables[one.name], figures) for one in shown if one.part == part]
            for part in PARTS
        },
        failures=first_failures(results, anchors),
        films=[_film(path) | {"anchor": anchors[path.stem]} for path in paths],
        missing=missing,
        failed=failed,
        cells=f"{len(results.frame):,}",
        episodes=f"{int(results.frame.episodes.sum()) if len(results.frame) else 0:,}",
        provenance=json.dumps(results.provenance, indent=2),
    )


def _shown(exhibit: Exhibit, table: pd.DataFrame, figures: Path) -> dict[str, object]:
    wide = exhibit.wide(table)
    path = figures / f"{exhibit.name}.svg"
    own = [exhibit.is_own(name) for name in exhibit.summarised(table).row.drop_duplicates()]
    texts = [[name, *map(_breakable, row)] for name, *row in wide.to_numpy().tolist()]
    return {
        "name": exhibit.name,
        "title": exhibit.title,
        "columns": list(wide.columns),
        "rows": list(zip(texts, own, strict=True)),
        "caption": exhibit.caption(table),
        "svg": _inline(exhibit.name, path.read_text()) if path.exists() else None,
    }


def _claim(claim: dict[str, Any]) -> dict[str, Any]:
    """Adds the verdict in the paper's tables as one word, see `reports.verdicts`."""
    word = claim["paper"].split(" ")[0]
    return claim | {"paper_word": word if word in ("holds", "fails") else "no numbers"}


def _counts(claims: pd.DataFrame) -> dict[str, int]:
    return {str(verdict): int(count) for verdict, count in claims.ours.value_counts().items()}


def _breakable(text: str) -> str:
    """Returns text in which a line can only break before the interval and the paper's number."""
    return re.sub(r" (?![\[(])", "\u00a0", text)


def _film(path: Path) -> dict[str, str]:
    task, _, what = path.stem.partition("-")
    data = base64.b64encode(path.read_bytes()).decode()
    return {"title": f"{display(task)}: {what.replace('-', ' ')}", "data": data}


def _inline(name: str, svg: str) -> Markup:
    """Returns an SVG of matplotlib as part of a page: with distinct ids, and no style or metadata.

    matplotlib escapes the texts that it draws.
    """
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"<style.*?</style>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'(href="#|url\(#)', rf"\1{name}-", svg)
    svg = re.sub(r' style="([^"]*)"', _as_attributes, svg)
    return Markup(re.sub(r'(?<=")#[0-9a-f]{6}(?=")', _as_variable, svg))


def _as_attributes(style: re.Match[str]) -> str:
    """Returns a style attribute as presentation attributes, which the content policy allows."""
    pairs = (part.split(":", 1) for part in style.group(1).split(";") if ":" in part)
    return "".join(f' {name.strip()}="{value.strip()}"' for name, value in pairs)


def _as_variable(colour: re.Match[str]) -> str:
    return _FOLLOWS.get(colour[0], colour[0])
