"""Files of learnt weights: what is written is read, and a wrong one is refused by name."""

import json
import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest

from methods.base import NotFittedError
from methods.contract import stored
from methods.kodex import Kodex
from methods.nearest import Nearest
from methods.saved import read, save
from methods.toy import LAYOUT, answer, toy
from tasks.errors import InputError
from tasks.files import from_bytes, to_bytes

SINGLE = Kodex.sizes["single"]


@pytest.fixture
def kodex():
    method = Kodex(SINGLE, LAYOUT)
    method.fit(toy(0, 4), toy(5, 2), 1)
    return method


def test_a_file_restores_the_method_and_holds_its_arrays_as_results_store_them(kodex, tmp_path):
    save(kodex, tmp_path / "kodex.safetensors")
    found = read(tmp_path / "kodex.safetensors")
    again = Kodex(SINGLE, LAYOUT)
    found.check(again, "door")
    again.load(from_bytes(found.parameters))
    assert np.array_equal(answer(again), answer(kodex))
    assert found.parameters == stored(kodex, found.facts["config"], LAYOUT).parameters


def test_the_same_arrays_have_the_same_digest_in_any_file(kodex, tmp_path):
    save(kodex, tmp_path / "one.safetensors")
    save(kodex, tmp_path / "another.safetensors")
    one, another = (read(tmp_path / f"{name}.safetensors") for name in ("one", "another"))
    assert one.digest == another.digest
    kodex.koopman[0, 0] += 1
    save(kodex, tmp_path / "another.safetensors")
    assert read(tmp_path / "another.safetensors").digest != one.digest


def test_a_method_that_has_learnt_nothing_cannot_be_saved(tmp_path):
    with pytest.raises(NotFittedError):
        save(Kodex(SINGLE, LAYOUT), tmp_path / "kodex.safetensors")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("method", "answer"),
    [
        (Nearest(Nearest.sizes["single"], LAYOUT), "method than nearest on door: 'kodex', not 'ne"),
        (
            Kodex(replace(SINGLE, observables=2), LAYOUT),
            "config than kodex on door: observables=.*, not observables=2 .change the run with",
        ),
        (
            Kodex(SINGLE, replace(LAYOUT, object_dim=15)),
            "dimensions than kodex on door: object_dim=7, not object_dim=15",
        ),
    ],
)
def test_a_file_of_another_fit_is_refused_with_the_difference(kodex, tmp_path, method, answer):
    save(kodex, tmp_path / "kodex.safetensors")
    with pytest.raises(InputError, match=answer):
        read(tmp_path / "kodex.safetensors").check(method, "door")


def test_a_file_of_another_version_is_refused(kodex, tmp_path, monkeypatch):
    save(kodex, tmp_path / "kodex.safetensors")
    monkeypatch.setattr(Kodex, "version", Kodex.version + 1)
    with pytest.raises(InputError, match=f"version than kodex on door: {Kodex.version - 1}, not"):
        read(tmp_path / "kodex.safetensors").check(kodex, "door")


class Bomb:
    def __reduce__(self):
        return (pytest.fail, ("it was unpickled",))


@pytest.mark.parametrize(
    ("content", "answer"),
    [
        (b"text", "is no file of weights"),
        (pickle.dumps(Bomb()), "is no file of weights: `bench.save_weights"),
        (to_bytes({"koopman": np.eye(2)}), "is no file of weights"),
        (to_bytes({"a": np.eye(2)}, learnt_by="{"), "is no file of weights"),
        (to_bytes({"a": np.eye(2)}, learnt_by=json.dumps([1])), "is no file of weights"),
        (to_bytes({"a": np.eye(2)}, learnt_by=json.dumps(asdict(LAYOUT))), "is no file of weigh"),
        (None, "cannot be read: No such file"),
    ],
)
def test_a_file_that_was_not_saved_is_refused_and_never_unpickled(tmp_path, content, answer):
    file = tmp_path / "mine.safetensors"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=answer):
        read(file)
