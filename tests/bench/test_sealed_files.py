import json

import numpy as np
import pyarrow as pa
import pytest

from bench.sealed_files import (
    DamagedError,
    read_content,
    read_folder,
    read_labels,
    read_record,
    read_table,
    seal_folder,
    seal_record,
    seal_table,
    write_folder,
)

TABLE = pa.table({"start": np.arange(5), "success": np.arange(5) % 2 == 0})


@pytest.fixture
def record(tmp_path):
    path = tmp_path / "record.json"
    path.write_bytes(seal_record({"numbers": (1, 2.5), "text": "a", "nested": {"b": None}}))
    return path


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "table.parquet"
    path.write_bytes(seal_table(TABLE, {"key": "k", "note": "sha256:"}))
    return path


@pytest.fixture
def folder(tmp_path):
    files = seal_folder("card.json", {"key": "k"}, {"weights": b"123", "more": b"45"})
    write_folder(tmp_path / "made" / "folder", files, tmp_path / "unfinished")
    return tmp_path / "made" / "folder"


def test_a_record_is_read_as_it_was_written(record):
    assert read_record(record) == {"numbers": [1, 2.5], "text": "a", "nested": {"b": None}}


def test_a_damaged_record_is_refused(record, damage):
    damage(record)
    with pytest.raises(DamagedError, match="record"):
        read_record(record)


def test_a_record_with_another_value_or_format_is_refused(record):
    content = json.loads(record.read_bytes())
    for change in ({"text": "b"}, {"format": 1}, {"self": "0"}):
        record.write_text(json.dumps(content | change))
        with pytest.raises(DamagedError):
            read_record(record)


def test_a_table_is_read_with_its_labels_whole_or_by_columns(table):
    assert read_table(table).column_names == ["start", "success"]
    chosen = read_table(table, ("success",))
    assert chosen.to_pydict() == {"success": [True, False, True, False, True]}
    labels, rows = read_labels(table)
    assert (labels["key"], labels["note"], rows) == ("k", "sha256:", 5)


def test_the_same_table_has_the_same_bytes(table):
    assert seal_table(TABLE, {"key": "k", "note": "sha256:"}) == table.read_bytes()


def test_a_damaged_table_is_refused(table, damage):
    damage(table)
    for read in (read_table, read_labels):
        with pytest.raises(DamagedError):
            read(table)


def test_every_flipped_bit_of_a_table_is_detected(table):
    content = table.read_bytes()
    for place in range(len(content)):
        table.write_bytes(
            content[:place] + bytes([content[place] ^ 1 << place % 8]) + content[place + 1 :]
        )
        with pytest.raises(DamagedError):
            read_labels(table)


def test_a_sealed_folder_is_read_with_its_files(folder):
    record = read_folder(folder, "card.json")
    assert record["key"] == "k"
    assert read_content(folder, record, "weights") == b"123"


@pytest.mark.parametrize("name", ["card.json", "weights", "more"])
def test_a_sealed_folder_with_a_damaged_or_missing_file_is_refused(folder, damage, name):
    damage(folder / name)
    with pytest.raises(DamagedError):
        read_folder(folder, "card.json")
    (folder / name).unlink()
    with pytest.raises(DamagedError):
        read_folder(folder, "card.json")
