import pytest

from tasks.words import count_of


@pytest.mark.parametrize(
    ("count", "said"), [(0, "0 tries"), (1, "1 try"), (2, "2 tries"), (12_345, "12,345 tries")]
)
def test_one_thing_is_counted_in_the_singular(count, said):
    assert count_of(count, "try", "tries") == said


def test_the_plural_has_an_s_unless_given():
    assert [count_of(1, "fit"), count_of(2, "fit")] == ["1 fit", "2 fits"]
