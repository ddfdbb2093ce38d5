import os
import stat
from functools import partial
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.files import (
    file_name,
    new_path,
    whole_file,
    whole_folder,
    writable_file,
    writable_folder,
)

FINDERS = [writable_folder, writable_file, new_path]


def everything(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture
def unwritable(tmp_path, monkeypatch):
    """A folder that cannot be written to."""

    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tasks.files.TemporaryFile", refuse)
    return tmp_path


@pytest.mark.parametrize("find", FINDERS)
@pytest.mark.parametrize("name", ["new", "a/b/new"])
def test_checking_a_writable_path_creates_nothing(tmp_path, find, name):
    assert find(tmp_path / name) == tmp_path / name
    assert everything(tmp_path) == []


@pytest.mark.parametrize("find", FINDERS)
def test_a_file_in_the_way_is_named(tmp_path, find):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=rf"{tmp_path}/file is no folder"):
        find(tmp_path / "file" / "a" / "b")


def test_a_broken_link_is_in_the_way_of_a_folder(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    with pytest.raises(InputError, match="link is no folder"):
        writable_folder(tmp_path / "link")


@pytest.mark.parametrize("find", FINDERS)
def test_a_path_without_permission_is_named(unwritable, find):
    answer = rf"{unwritable}/?\w*' cannot be written to \(Permission denied\): choose another"
    with pytest.raises(InputError, match=answer):
        find(unwritable / "new")


@pytest.mark.parametrize("find", FINDERS)
@pytest.mark.parametrize("name", ["/proc/new/new", "x" * 300, "a\0b/c"])
def test_an_impossible_path_is_refused(tmp_path, find, name):
    with pytest.raises(InputError, match="cannot be written to"):
        find(tmp_path / name)


def test_a_folder_or_device_is_not_replaced_by_a_file(tmp_path):
    with pytest.raises(InputError, match="is no file"):
        writable_file(tmp_path)
    with pytest.raises(InputError, match="is no file"):
        writable_file(Path("/dev/null"))


@pytest.mark.parametrize("make", [lambda path: path.touch(), lambda path: path.mkdir()])
def test_an_existing_path_is_refused_as_a_new_path(tmp_path, make):
    make(tmp_path / "old")
    with pytest.raises(InputError, match="old exists already"):
        new_path(tmp_path / "old")


def test_a_whole_file_replaces_an_older_one(tmp_path):
    target = tmp_path / "a" / "file.txt"
    for text in ("first", "second"):
        with whole_file(target) as path:
            assert path.suffix == ".txt"
            path.write_text(text)
        assert target.read_text() == text
    assert everything(tmp_path) == ["a", "a/file.txt"]


def test_a_whole_file_has_default_permissions(tmp_path):
    (tmp_path / "other").touch()
    with whole_file(tmp_path / "file") as path:
        path.write_text("text")
    modes = {stat.S_IMODE(os.stat(tmp_path / name).st_mode) for name in ("file", "other")}
    assert len(modes) == 1


def test_the_target_of_a_link_is_replaced_and_the_link_stays(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("folder/file")
    with whole_file(tmp_path / "link") as path:
        path.write_text("text")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "folder" / "file").read_text() == "text"


def test_a_file_can_be_written_through_a_broken_link(tmp_path):
    (tmp_path / "link").symlink_to("nothing")
    assert writable_file(tmp_path / "link") == tmp_path / "link"


def fill(path):
    (path / "data").mkdir()
    (path / "data" / "file").write_text("text")


def test_a_whole_folder_appears_at_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("plain", "a/b", "a/../up"):
        target = Path(name)
        with whole_folder(target) as path:
            assert path.is_absolute()
            fill(path)
            assert not target.exists()
        assert everything(target) == ["data", "data/file"]
    with pytest.raises(InputError, match="plain exists already"), whole_folder(Path("plain")):
        pass


def interrupted(write, target, begin, error):
    with write(target) as path:
        begin(path)
        raise error


@pytest.mark.parametrize("error", [OSError(28, "No space left"), KeyboardInterrupt(), SystemExit()])
@pytest.mark.parametrize(
    ("write", "begin"),
    [(whole_file, lambda path: path.write_text("half")), (whole_folder, fill)],
    ids=["file", "folder"],
)
def test_a_failed_write_leaves_nothing(tmp_path, write, begin, error):
    (tmp_path / "there").mkdir()
    with pytest.raises(type(error)):
        interrupted(write, tmp_path / "there" / "a" / "b" / "new", begin, error)
    assert everything(tmp_path) == ["there"]


def test_a_failed_write_leaves_the_older_file(tmp_path):
    (tmp_path / "old").write_text("old")
    with pytest.raises(OSError, match="full"):
        interrupted(
            whole_file, tmp_path / "old", lambda path: path.write_text("half"), OSError("full")
        )
    assert (tmp_path / "old").read_text() == "old"
    assert everything(tmp_path) == ["old"]


@pytest.mark.parametrize(
    ("write", "begin", "count"),
    [(whole_file, lambda path: path.write_text("text"), 2), (whole_folder, fill, 4)],
    ids=["file", "folder"],
)
def test_everything_is_synced_before_it_appears(tmp_path, monkeypatch, write, begin, count):
    synced = []
    monkeypatch.setattr("tasks.files.sync", partial(list.append, synced))
    with write(tmp_path / "new") as path:
        begin(path)
    assert len(synced) == count
    assert synced[-1] == tmp_path


def test_a_name_for_a_file_has_no_separators_and_stays_short_and_distinct():
    assert file_name(["door", "kodex:cutoff=1/2", "s1"]) == "door-kodex_cutoff=1_2-s1"
    long, other = (file_name(["x" * 500, last]) for last in "ab")
    assert long != other
    assert len(long) == len(other) == 200
