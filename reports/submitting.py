"""`bench submit`: packs the results of a package's method as one row beside the shipped results."""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from bench.checking import known
from bench.labels import EXPERT, VALIDATION, labels_of, plain
from bench.package_source import package_source
from bench.packed import shipped
from bench.parsing import seeds_text
from bench.repeatable import check_repeatable
from bench.results import Results as StoredResults
from bench.submission import Origin, Submission, seal_submission
from methods.registry import SUITE
from reports.comparable import check_comparable, lacking, main_rows, named, required
from reports.mixed import MixedProtocols
from reports.pairing import without_expert
from reports.protocol import SEEDS, differences
from reports.results import SPLITS, Results
from tasks.errors import InputError
from tasks.files import whole_file


def submit(folder: Path, method: str | None, missing: Sequence[str], out: Path) -> Submission:
    """Writes the file of a row, and returns it.

    Args:
        folder: of `bench run`.
        method: label of the method. Default: the only one that is not the suite's.
        missing: tasks that the row leaves out.
        out: the file.

    Raises:
        InputError: the row is incomplete, cannot be compared with the shipped results, or cannot be
            repeated with what is installed here.
    """
    results = Results(folder)
    label = _label(results, method)
    name = plain(label)
    rows = _rows(results, label, missing).assign(method=name)
    origin = Origin(name, known(name).version, package_source(name), tuple(missing))
    assert isinstance(results.source, StoredResults)
    content = seal_submission(origin, results.source, rows)
    with TemporaryDirectory() as place:
        draft = Path(place) / out.name
        draft.write_bytes(content)
        check_submitted(draft)
    with whole_file(out) as file:
        file.write_bytes(content)
    return Submission(out)


def check_submitted(path: Path) -> Submission:
    """Returns the row of a file after checking that it can be compared, and repeated here.

    Raises:
        InputError: it cannot.
    """
    row, reference = Results(path), Results(shipped())
    check_comparable(row, reference, required(reference))
    assert isinstance(row.source, Submission)
    check_repeatable(row.source)
    protocols = other_protocols(row, main_rows(row, row.source.origin.method), reference)
    if protocols:
        raise InputError(protocols.text)
    return row.source


def other_protocols(
    results: Results, rows: pd.DataFrame, reference: Results
) -> MixedProtocols | None:
    """Returns in which settings rows of results differ from the shipped ones; None if in none."""
    theirs = pd.concat(reference.rows.main(split=split) for split in SPLITS)
    theirs = theirs[theirs.task.isin(rows.task)]

    def specs(key: str) -> dict[str, object]:
        in_row = key in set(rows.controller_key)
        return (results if in_row else reference).controller_spec(key)

    found = differences(pd.concat([rows, theirs]), specs)
    found = found[found.setting != SEEDS]  # `lacking` names those that a row needs
    shipped_methods = tuple(without_expert(theirs).method.unique())
    return None if found.empty else MixedProtocols(found, results.folder, shipped_methods)


def _label(results: Results, method: str | None) -> str:
    """Returns the label of the only method of a package, or of the one named."""
    labels = list(results.frame.method.unique())
    own = [label for label in labels if plain(label) not in (*SUITE, EXPERT)]
    if not own:
        raise InputError(
            f"{results.folder} holds no method of a package: {', '.join(labels)} are the suite's"
        )
    found = labels_of(method, own) if method else own
    if len(found) > 1:
        raise InputError(f"a file holds one row: choose with --method from {', '.join(found)}")
    return found[0]


def _rows(results: Results, label: str, missing: Sequence[str]) -> pd.DataFrame:
    """Returns the evaluations of a row, after checking that they are all, and comparable."""
    reference = Results(shipped())
    needed = required(reference)
    needed = needed[~needed.task.isin(missing)]
    if needed.empty:
        raise InputError("--missing leaves out every task of the shipped results")
    rows = main_rows(results, label)
    rows = rows[rows.task.isin(needed.task)]
    protocols = other_protocols(results, rows, reference) if len(rows) else None
    if protocols:
        raise InputError(f"{protocols.text}\nget comparable rows: {protocols.command(rows)}")
    _check_whole(results, label, lacking(rows, needed))
    every = pd.concat([rows, results.rows.select(method=label, split=VALIDATION)])
    return every.merge(needed[["task", "seed"]].drop_duplicates())


def _check_whole(results: Results, label: str, left: pd.DataFrame) -> None:
    """Raises InputError, with the command that runs what is left, unless nothing is."""
    if left.empty:
        return
    experiments = {"test": "success", "ood": "ood"}
    chosen = ",".join(experiments[split] for split in SPLITS if split in set(left.split))
    raise InputError(
        f"{label} lacks what the shipped methods have: {named(left)}\n"
        f"run it: bench run paper --experiments {chosen} --tasks {','.join(left.task.unique())}"
        f" --methods {plain(label)} --seeds {seeds_text(left.seed)}"
        f" --episodes {left.episodes.max()} --out {results.folder}\n"
        "or leave a task out of the row with --missing"
    )
