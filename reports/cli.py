"""`bench report` and `bench compare`: stored results to tables and figures."""

from pathlib import Path
from typing import Annotated

import typer

from bench.options import AsJson


def report(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    export: Annotated[Path | None, typer.Option(help="Parquet file for all episodes.")] = None,
) -> None:
    """Write the tables and figures of stored results into FOLDER/report."""
    import bench
    from reports.results import Results
    from reports.write import write_report

    written = write_report(Results(folder), folder / "report")
    for path in written:
        print(path.read_text())
    if export is not None:
        bench.load(folder).to_parquet(export, index=False)
    print(f"{len(written)} exhibit(s) in {folder / 'report'}")


def compare(
    folder: Annotated[Path, typer.Argument(help="Results folder of `bench run`.")],
    methods: Annotated[str, typer.Option(help="Two or more, comma-separated.")],
    as_json: AsJson = False,
) -> None:
    """Compare methods on the same starts: difference, 95% interval, p, and q of false discovery."""
    from reports.compare import compare as compare_methods
    from reports.results import Results

    table = compare_methods(Results(folder), methods.split(","))
    if as_json:
        print(table.to_json(orient="records"))
    else:
        print(table.to_markdown(index=False, floatfmt=".3g"))
