"""Brings the tables that documents quote up to date: ``python docs/refresh.py REPORT PAGE...``.

A quoted table stands below ``<!-- name -->``, where ``REPORT/tables/name.md`` is what it quotes.
"""

import re
import sys
from pathlib import Path

QUOTED = re.compile(r"(<!-- (\w+) -->\n\n)(?:\|.*\n)*\n?")


def refresh(page: str, report: Path) -> str:
    """Returns a page with its quoted tables those of a report."""

    def current(quoted: re.Match[str]) -> str:
        lines = (report / f"tables/{quoted[2]}.md").read_text().splitlines()
        rows = [line for line in lines if line.startswith("|")]
        return quoted[1] + "\n".join(rows) + "\n\n"

    return QUOTED.sub(current, page)


if __name__ == "__main__":
    for path in map(Path, sys.argv[2:]):
        path.write_text(refresh(path.read_text(), Path(sys.argv[1])))
