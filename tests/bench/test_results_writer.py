import pytest

from bench.names import folder_name
from bench.results_writer import writing
from bench.spec import Evaluation
from bench.stored_files import Times
from tasks.errors import InputError


def set_aside(stored):
    return sorted(path.name for path in (stored.writer.folder / "damaged").glob("*"))


def test_more_episodes_extend_an_evaluation_to_the_bytes_of_one_in_a_single_piece(stored):
    stored.writer.add_episodes(stored.fit, stored.evaluation, stored.episodes(2, 6), keep=2)
    path = stored.path("cells/*/*.parquet")
    extended = path.read_bytes()
    assert list(stored.results.episodes(stored.wanted).start) == [0, 1, 2, 3, 4, 5]
    stored.writer.add_episodes(stored.fit, stored.evaluation, stored.episodes(0, 6))
    assert path.read_bytes() == extended
    assert set_aside(stored) == []


def test_episodes_of_another_version_are_set_aside_when_new_ones_are_stored(stored, capsys):
    before = stored.path("cells/*/*.parquet").read_bytes()
    other = Evaluation("door", "test", controller_key="d")
    stored.writer.add_episodes(stored.fit, other, stored.episodes(0, 2))
    assert stored.results.stored_episodes(stored.cell(stored.fit, other).wanted) == 2
    assert stored.path("damaged/*").read_bytes() == before
    assert "of another version of the task or of the controller; set aside as" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize("name", ["fit.json", "weights.safetensors", "eval-*.parquet"])
def test_detected_damage_is_set_aside_and_can_be_stored_again(stored, damage, name, capsys):
    damage(stored.path(f"cells/*/{name}"))
    results = stored.writer.results
    assert results.stored_episodes(stored.wanted) == 0
    assert capsys.readouterr().err == ""
    stored.writer.set_aside_damage()
    assert capsys.readouterr().err.count("set aside as") == len(set_aside(stored)) == 1
    assert results.damaged == {}
    if not results.has_fit(stored.fit):
        stored.writer.add_fit(stored.fit, stored.weights, stored.losses, {})
    stored.writer.add_episodes(stored.fit, stored.evaluation, stored.episodes(0, 4))
    assert results.stored_episodes(stored.wanted) == 4


def test_new_files_replace_damaged_ones(stored, damage, capsys):
    folder = stored.results.frame().loc[0, "folder"]
    stored.writer.add_times(folder, Times([1.0]))
    stored.writer.add_failure("one", "reason", "traceback")
    for pattern in ("cells/*/eval-*", "cells/*/times.json", "failures/*"):
        damage(stored.path(pattern))
    results = stored.writer.results
    assert (results.times(folder), results.failures()) == (None, [])
    stored.writer.add_episodes(stored.fit, stored.evaluation, stored.episodes(0, 4))
    stored.writer.add_times(folder, Times([2.0]))
    stored.writer.add_failure("one", "reason", "traceback")
    stored.writer.set_aside_damage()
    assert len(set_aside(stored)) == 3
    assert results.stored_episodes(stored.wanted) == 4
    assert results.times(folder) == Times([2.0], [])
    assert [one["tries"] for one in results.failures()] == [1]


def test_damage_is_set_aside_when_writing_ends(stored, tmp_path, damage, capsys):
    path = stored.path("cells/*/weights.safetensors")
    damage(path)
    with writing(tmp_path / "other") as writer:
        writer.write_folder(writer.folder / "cells" / path.parent.name, {"fit.json": b""})
        assert not writer.results.has_fit(stored.fit)
    assert not (tmp_path / "other" / "cells" / path.parent.name).exists()
    assert "set aside as" in capsys.readouterr().err


def test_tries_of_a_failure_add_up_until_it_is_cleared(stored):
    stored.writer.add_failure("one", "first", "", tries=2)
    stored.writer.add_failure("one", "second", "trace")
    assert stored.results.failures() == [
        {"label": "one", "tries": 3, "reason": "second", "traceback": "trace"}
    ]
    stored.writer.clear_failure("one")
    stored.writer.clear_failure("one")
    assert stored.results.failures() == []


def test_a_second_writer_is_refused(stored):
    with (
        pytest.raises(InputError, match="another run is writing"),
        writing(stored.writer.folder),
    ):
        pass


def test_unfinished_files_of_an_interrupted_writer_are_removed(tmp_path):
    left = tmp_path / ".unfinished" / "cell"
    left.mkdir(parents=True)
    with writing(tmp_path):
        assert not left.exists()


def test_the_folder_of_a_long_label_has_a_name_that_file_systems_allow():
    names = {folder_name("longest" * 50, digit * 64) for digit in "0f"}
    assert len(names) == 2
    assert max(map(len, names)) < 255
