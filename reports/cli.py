"""`bench report`: stored results to tables and figures."""

from pathlib import Path
from typing import Annotated

import typer


def report(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
) -> None:
    """Write the tables and figures of stored results into FOLDER/report."""
    from reports.results import Results
    from reports.write import write_report

    written = write_report(Results(folder), folder / "report")
    for path in written:
        print(path.read_text())
    print(f"{len(written)} exhibit(s) in {folder / 'report'}")
