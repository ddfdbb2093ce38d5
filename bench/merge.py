"""Merges results folders, for example from several machines, into one."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench.manifest import Manifest, Wanted
from bench.names import cell_path, evaluation_path
from bench.other_kernels import check_alike
from bench.results import Results
from bench.results_writer import ResultsWriter, writing
from bench.same_bits import first_difference
from tasks.errors import InputError


def merge(folders: Sequence[Path], out: Path) -> int:
    """Copies the undamaged results of several folders into one; returns the number of fits.

    If two folders hold the same evaluation, the one with more episodes is kept. Damaged files are
    not copied; those in ``out`` are set aside.

    Raises:
        InputError: a folder holds no results, or two hold different results under one label, or
            other bits of what was computed alike, see `bench.same_bits`, or their kernels are
            marked differently.
    """
    sources = [Results(folder) for folder in folders]
    with writing(out) as writer:
        manifest = writer.results.manifest()
        for source in sources:
            source.check_exists()
        check_alike((source.folder, source.marks()) for source in (writer.results, *sources))
        for source in sources:
            manifest = _joined(manifest, source)
        for source in sources:
            for wanted in source.manifest().wanted:
                _copy(source, wanted, writer)
        writer.write_manifest(manifest)
    return len({wanted.fit for wanted in manifest.wanted})


def _joined(manifest: Manifest, source: Results) -> Manifest:
    """The manifest extended by that of a source; of each evaluation, the most episodes count.

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
                " it: the version, config, controller or demonstrations differ; merge only results"
                " with the same settings"
            )
        most.append(replace(wanted, episodes=max(wanted.episodes, known.episodes)))
    joined = manifest.extended(most)
    return Manifest(joined.wanted, tuple(dict.fromkeys(joined.notes + theirs.notes)))


def _copy(source: Results, wanted: Wanted, writer: ResultsWriter) -> None:
    """Copies an evaluation, its fit and its controllers, unless they are stored already."""
    there, fit = writer.results, wanted.fit
    difference = first_difference(there, source, wanted)
    if difference:
        raise InputError(
            f"{source.folder} and a folder before it differ in what must have the same bits:"
            f" {difference}"
        )
    for controller in wanted.controllers:
        if source.has_controller(controller) and not there.has_controller(controller):
            writer.write_controller(controller, source.controller_files(controller))
    if not source.has_fit(fit):
        return
    if not there.has_fit(fit):
        writer.write_fit(fit, source.fit_files(fit))
    folder = cell_path(writer.folder, fit).name
    times = source.times(folder)
    if times and not there.times(folder):
        writer.add_times(folder, times)
    if there.stored_episodes(wanted) < source.stored_episodes(wanted):
        path = evaluation_path(source.folder, fit, wanted.evaluation.label)
        writer.write_evaluation(wanted, path.read_bytes())
