"""The report as one self-contained HTML page: no network, nothing but itself."""

import base64
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from reports.answer import HOW
from reports.exhibit import PARTS, Exhibit
from reports.front import failures, strips, study
from reports.results import Results
from reports.style import INK, ON_DARK, display

TEMPLATES = Path(__file__).with_name("templates")
NONCE = "kodex-bench"
"""Of the page's own style and script. The page is a file: nobody else's text is ever let through
unescaped, and the policy stops what would slip in."""
SUCCESS = "unseen"
"""The exhibit that the page opens with."""
_FOLLOWS = {
    **dict.fromkeys(("#000000", "#262626", INK), "currentColor"),
    "#ffffff": "var(--paper)",
    **dict.fromkeys(("#cccccc", "#b0b0b0"), "var(--line)"),
    **{colour: f"var(--{colour[1:]})" for colour in ON_DARK},
}
"""By colour of a figure's file, the one that follows the theme of the page."""


def render(
    results: Results,
    tables: dict[str, pd.DataFrame],
    exhibits: list[Exhibit],
    claims: pd.DataFrame,
    figures: Path,
    films: Path | None = None,
    failed: Mapping[str, str] | None = None,
    answer: Sequence[str] = (),
) -> str:
    """Returns the page.

    Args:
        results: of a run.
        tables: by name of exhibit; exhibits without one are named as missing.
        exhibits: in the order of the page.
        claims: as `reports.claims.verdicts` gives them.
        figures: where the SVG files of the exhibits are.
        films: where the MP4 files of `bench video` are, if there are any.
        failed: by title, why an exhibit or a claim could not be made.
        answer: as `reports.answer.answer` gives it.
    """
    shown = [exhibit for exhibit in exhibits if exhibit.name in tables]
    failed = failed or {}
    left = (exhibit.title for exhibit in exhibits if exhibit.name not in tables)
    missing = [title for title in left if title not in failed]
    paths = sorted(films.glob("[!.]*.mp4")) if films else []
    anchors = {path.stem: f"film-{path.stem}" for path in paths}
    first = next((exhibit for exhibit in shown if exhibit.name == SUCCESS), None)
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True)
    return environment.get_template("page.html").render(
        title="Imitation policies on a dexterous hand",
        nonce=NONCE,
        on_dark=ON_DARK,
        notes=results.notes,
        study=study(results),
        answer=answer,
        how=HOW,
        success=first and strips(results, first, tables[SUCCESS]),
        claims=[_claim(claim) for claim in claims.to_dict("records")],
        counts=", ".join(f"{count} {verdict}" for verdict, count in _counts(claims).items()),
        parts={
            part: [_shown(one, tables[one.name], figures) for one in shown if one.part == part]
            for part in PARTS
        },
        failures=failures(results, anchors),
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
    """A claim with the verdict of the paper's tables in a word, see `reports.claims`."""
    word = claim["paper"].split(" ")[0]
    return claim | {"paper_word": word if word in ("holds", "fails") else "no numbers"}


def _counts(claims: pd.DataFrame) -> dict[str, int]:
    return {str(verdict): int(count) for verdict, count in claims.ours.value_counts().items()}


def _breakable(text: str) -> str:
    """Text that breaks before its interval and the paper's number alone, where a line is short."""
    return re.sub(r" (?![\[(])", "\u00a0", text)


def _film(path: Path) -> dict[str, str]:
    task, _, what = path.stem.partition("-")
    data = base64.b64encode(path.read_bytes()).decode()
    return {"title": f"{display(task)}: {what.replace('-', ' ')}", "data": data}


def _inline(name: str, svg: str) -> Markup:
    """An SVG that matplotlib drew, as part of a page: ids of its own, no style, no metadata.

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
    """A style attribute as presentation attributes, which a strict content policy allows."""
    pairs = (part.split(":", 1) for part in style.group(1).split(";") if ":" in part)
    return "".join(f' {name.strip()}="{value.strip()}"' for name, value in pairs)


def _as_variable(colour: re.Match[str]) -> str:
    return _FOLLOWS.get(colour[0], colour[0])
