"""Results of pinned kernels and others are never put together."""

from dataclasses import replace
from pathlib import Path

import pytest

from bench.merge import merge
from bench.other_kernels import check_kernels
from bench.packed import pack
from bench.results_writer import writing
from reports.reference import WithShippedMethods
from tasks.errors import InputError
from tasks.pins import PINNED, UNPINNED


@pytest.fixture
def unpinned(stored, tmp_path):
    """Results of another seed, computed with other kernels."""
    fit = replace(stored.fit, seed=7, pins=UNPINNED)
    with writing(tmp_path / "unpinned") as writer:
        writer.ask_for([stored.cell(fit, stored.evaluation).wanted])
        writer.add_fit(fit, stored.weights, stored.losses, {"seconds": 1.5})
        writer.add_episodes(fit, stored.evaluation, stored.episodes(0, 4))
    return writer.results


def test_a_run_refuses_a_folder_with_results_of_other_kernels(stored, unpinned, monkeypatch):
    monkeypatch.setattr("bench.other_kernels.mark", lambda: PINNED)
    check_kernels(stored.results)
    answer = f"unpinned holds results of kernels marked {UNPINNED}, and here they are marked"
    with pytest.raises(InputError, match=answer):
        check_kernels(unpinned)


@pytest.mark.parametrize("join", [merge, pack])
def test_results_of_different_kernels_are_not_put_together(join, stored, unpinned, tmp_path):
    folders = [stored.results.folder, unpinned.folder]
    answer = f"{PINNED} in {folders[0]}, {UNPINNED} in {folders[1]}"
    with pytest.raises(InputError, match=answer):
        join(folders, tmp_path / "out")
    assert not list(Path(tmp_path / "out").glob("cells"))


def test_a_note_says_that_shipped_results_have_other_kernels(stored, unpinned):
    notes = [WithShippedMethods(one).notes()[-1] for one in (stored.results, unpinned)]
    assert sum("with kernels marked" in note for note in notes) == 1
