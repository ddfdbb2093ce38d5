import json
from dataclasses import replace

import pytest

from bench.manifest import Manifest, Name, Wanted, read_manifest
from bench.sealed_files import seal_record
from tasks.errors import InputError

KEYS = [f"{number:064x}" for number in range(9)]
FIT, TRACKER = Name("door-kodex", KEYS[0]), Name("door-original-nominal", KEYS[1])
START = Name("door-original-nominal-s1", KEYS[7])
TEST = Wanted(FIT, Name("eval-test", KEYS[2]), 20, TRACKER, start=START)
OOD = Wanted(FIT, Name("eval-ood", KEYS[3]), 10, TRACKER)
EXPERT = Wanted(Name("door-expert", KEYS[4]), Name("eval-test", KEYS[5]), 20)


def test_a_manifest_is_read_as_it_was_written(tmp_path):
    assert read_manifest(tmp_path) == Manifest()
    manifest = Manifest().extended([TEST, OOD, EXPERT], "reduced")
    (tmp_path / "study.json").write_bytes(manifest.to_bytes())
    assert read_manifest(tmp_path) == manifest


def test_the_order_of_studies_does_not_change_the_manifest():
    one = Manifest().extended([TEST]).extended([EXPERT, OOD])
    assert one == Manifest().extended([OOD, EXPERT]).extended([TEST])


def test_the_last_requested_episodes_count_and_notes_appear_once():
    manifest = Manifest().extended([TEST, OOD], "a").extended([replace(TEST, episodes=30)], "b")
    assert {one.episodes for one in manifest.wanted} == {30, 10}
    assert manifest.extended([], "a").notes == ("a", "b")


def test_another_fit_of_the_same_label_replaces_the_evaluations_of_the_first():
    other = replace(TEST, fit=Name(FIT.label, KEYS[6]))
    assert Manifest().extended([TEST, OOD, EXPERT]).extended([other]).wanted == (EXPERT, other)


@pytest.mark.parametrize(
    ("part", "value"),
    [
        ("episodes", "20"),
        ("fit", {"label": "../x", "key": KEYS[0]}),
        ("evaluation", {"label": "eval", "key": "12"}),
        ("controller", "door"),
        ("start", "door"),
    ],
)
def test_a_damaged_manifest_is_refused_with_a_way_out(tmp_path, part, value):
    record = {"notes": [], "wanted": [json.loads(Manifest((TEST,)).to_bytes())["wanted"][0]]}
    path = tmp_path / "study.json"
    path.write_bytes(seal_record(record))
    assert read_manifest(tmp_path).wanted == (TEST,)
    record["wanted"][0][part] = value
    for content in (seal_record(record), b"[]", b""):
        path.write_bytes(content)
        with pytest.raises(InputError, match="remove it and run the study again"):
            read_manifest(tmp_path)
