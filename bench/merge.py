"""Merge results folders, as from several machines, into one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench.manifest import Manifest, Wanted
from bench.names import cell_path, controller_path, evaluation_path
from bench.results import Results
from bench.results_writer import ResultsWriter, writing
from bench.same_bits import first_difference
from tasks.errors import InputError


def merge(folders: Sequence[Path], out: Path) -> int:
    """Copies everything sound of several results folders into one; returns how many fits there are.

    Where two hold the same evaluation, the one of more episodes is kept. What is damaged is left
    out; in ``out`` it is set aside.

    Raises:
        InputError: a folder holds no results, or two hold different results under one label, or
            other bits of what was computed alike, see `bench.same_bits`.
    """
    sources = [Results(folder) for folder in folders]
    with writing(out) as writer:
        manifest = writer.results.manifest()
        for source in sources:
            source.check_exists()
            manifest = _joined(manifest, source)
        for source in sources:
            for wanted in source.manifest().wanted:
                _copy(source, wanted, writer)
        writer.write_manifest(manifest)
    return len({wanted.fit for wanted in manifest.wanted})


def _joined(manifest: Manifest, source: Results) -> Manifest:
    """The manifest with all that a source has been asked for, of each evaluation the most episodes.

    Raises:
        InputError: see `merge`.
    """
    fits = {one.fit.label: one.fit for one in manifest.wanted}
    places = {one.place: one for one in manifest.wanted}
    theirs = source.manifest()
    most = []
    for wanted in theirs.wanted:
        known = places.get(wanted.place, wanted)
        alike = known.evaluation == wanted.evaluation
        if not alike or fits.get(wanted.fit.label, wanted.fit) != wanted.fit:
            raise InputError(
                f"{source.folder} holds other results of {wanted.fit.label} than a folder before"
                " it: of another version, config, controller or set of demonstrations, or"
                " pinned and unpinned (see bench doctor); merge what was run alike"
            )
        most.append(replace(wanted, episodes=max(wanted.episodes, known.episodes)))
    joined = manifest.extended(most)
    return Manifest(joined.wanted, tuple(dict.fromkeys(joined.notes + theirs.notes)))


def _copy(source: Results, wanted: Wanted, writer: ResultsWriter) -> None:
    """Copies an evaluation with its fit and controller, unless they are there."""
    there, fit, controller = writer.results, wanted.fit, wanted.controller
    difference = first_difference(there, source, wanted)
    if difference:
        raise InputError(
            f"{source.folder} and a folder before it differ in what must have the same bits:"
            f" {difference}"
        )
    if controller and source.has_controller(controller) and not there.has_controller(controller):
        path = controller_path(writer.folder, controller)
        writer.write_folder(path, source.controller_files(controller))
    if not source.has_fit(fit):
        return
    if not there.has_fit(fit):
        writer.write_folder(cell_path(writer.folder, fit), source.fit_files(fit))
    folder = cell_path(writer.folder, fit).name
    times = source.times(folder)
    if times and not there.times(folder):
        writer.add_times(folder, times)
    if there.stored_episodes(wanted) < source.stored_episodes(wanted):
        path = evaluation_path(source.folder, fit, wanted.evaluation.label)
        writer.write_evaluation(wanted, path.read_bytes())
