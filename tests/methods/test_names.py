import numpy as np
import pytest

from methods.names import check_label
from methods.registry import get_method
from tasks.errors import InputError
from tasks.names import RESERVED, check_name, check_new_name


@pytest.mark.parametrize("name", ["mine", "bc", "a", "x" * 40, "method_2", "numpy", "match"])
def test_a_plain_word_is_a_valid_method_name(name):
    check_name("method", name)


BAD = {
    "an empty name": "",
    "a capital": "Mine",
    "an underscore first": "_x",
    "a digit first": "1st",
    "an accent": "methodé",
    "a digit of another script": "m٣",
    "a dash": "my-method",
    "a slash": "../x",
    "a line break": "mine\n",
    "41 characters": "x" * 41,
    "a very long name": "x" * 10**6,
    "a surrogate": "a\ud800",
    "a number": 3,
    "nothing": None,
    "an array": np.ones(3),
    "a keyword": "class",
    "the standard library": "random",
}


@pytest.mark.parametrize("name", [*BAD.values(), *RESERVED], ids=[*BAD, *RESERVED])
def test_an_invalid_method_name_is_refused(name):
    with pytest.raises(InputError, match="a method cannot be called") as refused:
        check_name("method", name)
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 200


def test_a_method_name_in_use_is_refused():
    with pytest.raises(InputError, match="'nn': there is a method"):
        check_name("method", "nn", ["kodex", "nn"])


@pytest.mark.parametrize("name", ["numpy", "torch", "pytest"])
def test_the_name_of_an_installed_module_is_refused_for_a_new_method(name):
    with pytest.raises(InputError, match=f"'{name}': a module of that name is installed"):
        check_new_name("method", name, [])


def test_the_name_of_a_plain_folder_is_allowed_for_a_new_method(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    monkeypatch.syspath_prepend(str(tmp_path))
    check_new_name("method", "mine", [])


@pytest.mark.parametrize("kind", ["size", "variant"])
@pytest.mark.parametrize("name", ["single", "1.5M", "set_1", "C++", "x" * 40])
def test_a_plain_word_is_a_valid_label(kind, name):
    check_label(kind, name)


@pytest.mark.parametrize("name", ["w/o", "", ".", "..", "+x", "_x", "a b", "a-b", "é", "x" * 41, 3])
def test_an_invalid_label_is_refused(name):
    with pytest.raises(InputError, match="a size cannot be called"):
        check_label("size", name)


@pytest.mark.parametrize("name", ["kodex", "nn", "lstm", "ndp", "ngf"])
def test_the_labels_of_built_in_methods_are_valid(name):
    method = get_method(name)
    for kind, names in (("size", method.sizes), ("variant", method.variants)):
        for one in names:
            check_label(kind, one)
