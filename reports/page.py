"""The report as one self-contained HTML page: no network, nothing but itself."""

import base64
import json
import re
from collections.abc import Mapping
from pathlib import Path

import pandas as pd
from jinja2 import Environment, FileSystemLoader
from markupsafe import Markup

from reports.exhibit import Exhibit
from reports.results import Results
from reports.style import display

TEMPLATES = Path(__file__).with_name("templates")
NONCE = "kodex-bench"
"""Of the page's own style and script. The page is a file: nobody else's text is ever let through
unescaped, and the policy stops what would slip in."""


def render(
    results: Results,
    tables: dict[str, pd.DataFrame],
    exhibits: list[Exhibit],
    claims: pd.DataFrame,
    figures: Path,
    films: Path | None = None,
    failed: Mapping[str, str] | None = None,
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
    """
    shown = [exhibit for exhibit in exhibits if exhibit.name in tables]
    failed = failed or {}
    left = (exhibit.title for exhibit in exhibits if exhibit.name not in tables)
    missing = [title for title in left if title not in failed]
    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True)
    return environment.get_template("page.html").render(
        title="Imitation policies on a dexterous hand",
        nonce=NONCE,
        notes=results.notes,
        parts=[_part(exhibit, tables[exhibit.name], figures) for exhibit in shown],
        films=[_film(path) for path in sorted(films.glob("[!.]*.mp4"))] if films else [],
        claims=claims.to_dict("records"),
        missing=missing,
        failed=failed,
        cells=f"{len(results.frame):,}",
        episodes=f"{int(results.frame.episodes.sum()) if len(results.frame) else 0:,}",
        provenance=json.dumps(results.provenance, indent=2),
    )


def _part(exhibit: Exhibit, table: pd.DataFrame, figures: Path) -> dict[str, object]:
    wide = exhibit.wide(table)
    path = figures / f"{exhibit.name}.svg"
    return {
        "name": exhibit.name,
        "title": exhibit.title,
        "short": exhibit.title.split(":")[0],
        "columns": list(wide.columns),
        "rows": [[name, *map(_breakable, row)] for name, *row in wide.to_numpy().tolist()],
        "caption": exhibit.caption(table),
        "svg": _inline(exhibit.name, path.read_text()) if path.exists() else None,
    }


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
    return Markup(re.sub(r' style="([^"]*)"', _as_attributes, svg))


def _as_attributes(style: re.Match[str]) -> str:
    """A style attribute as presentation attributes, which a strict content policy allows."""
    pairs = (part.split(":", 1) for part in style.group(1).split(";") if ":" in part)
    return "".join(f' {name.strip()}="{value.strip()}"' for name, value in pairs)
