"""Lists, numbers, seeds and settings as users write them on a command line."""

import pytest

from bench.cores import cores, count_jobs
from bench.parsing import known_names, names, scalar, seeds, seeds_text, settings, whole_number
from tasks.errors import InputError


@pytest.mark.parametrize("text", ["door,tool", " door , tool ", "door,,tool,", "door,tool,door"])
def test_a_list_may_have_spaces_empty_entries_and_repeated_names(text):
    assert names("--tasks", text) == ("door", "tool")
    assert known_names("--tasks", "task", text, ("tool", "door", "pen")) == ("tool", "door")


@pytest.mark.parametrize("text", ["", " ", ",", " , ,"])
def test_a_list_without_a_name_is_refused(text):
    with pytest.raises(InputError, match="--tasks takes names"):
        names("--tasks", text)


def test_every_name_of_a_list_is_checked():
    with pytest.raises(InputError, match=r"unknown task 'dor': .* did you mean 'door'"):
        known_names("--tasks", "task", "tool, dor", ("tool", "door"))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("5", (1, 2, 3, 4, 5)),
        (" 2 ", (1, 2)),
        ("2,4", (2, 4)),
        ("4, 2, 4", (4, 2)),
        ("7,", (7,)),
        ("1-5", (1, 2, 3, 4, 5)),
        ("1-3,7", (1, 2, 3, 7)),
        ("2 - 3, 3-4", (2, 3, 4)),
        ("3-3", (3,)),
    ],
)
def test_seeds_are_a_number_a_list_or_ranges(text, expected):
    assert seeds(text) == expected


@pytest.mark.parametrize(
    ("chosen", "text"), [((1, 2, 3), "3"), ((4, 2, 4), "2,4"), ((7,), "7,"), ((1,), "1")]
)
def test_seeds_are_written_as_they_are_read(chosen, text):
    assert seeds_text(chosen) == text
    assert set(seeds(text)) == set(chosen)


@pytest.mark.parametrize(
    "text", ["", ",", "x", "0", "0,", "-1", "5-1", "0-3", "1-", "-", "1.5", "1e1", "9" * 5000]
)
def test_invalid_seeds_are_refused(text):
    with pytest.raises(InputError, match="--seeds takes a number of seeds"):
        seeds(text)


@pytest.mark.parametrize("text", ["999999999", "1-999999999", "1-9999,20000,20001"])
def test_more_than_10000_seeds_are_refused(text):
    with pytest.raises(InputError, match="at most 10,000 seeds"):
        seeds(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("500", 500), ("1e4", 10_000), ("10_000", 10_000), ("1.5e3", 1500), ("2.0", 2), ("+7", 7)],
)
def test_whole_numbers_may_have_exponents_and_underscores(text, expected):
    found = whole_number(text, 1)
    assert (found, type(found)) == (expected, int)


@pytest.mark.parametrize(
    "text", ["1.5", "10,000", "0", "-3", "x", "", "nan", "inf", "1e-3", "1e10", "1e999999999"]
)
def test_invalid_whole_numbers_are_refused(text):
    with pytest.raises(InputError, match="must be a whole number from 1 to 999,999,999"):
        whole_number(text, 1)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("3", 3), ("10_000", 10_000), ("1e4", 1e4), ("[64, 32]", [64, 32]), ("true", True)],
)
def test_setting_values_are_json_numbers_or_text(text, expected):
    assert scalar(text) == expected
    assert settings([f"nn.epochs={text}"]) == {("nn", "epochs"): expected}
    assert scalar("64,32") == "64,32"


def test_jobs_come_from_the_option_the_environment_or_the_cores(monkeypatch):
    monkeypatch.delenv("BENCH_JOBS", raising=False)
    assert (count_jobs(3), count_jobs(-1), count_jobs()) == (3, cores(), cores())
    monkeypatch.setenv("BENCH_JOBS", "2")
    assert (count_jobs(), count_jobs(-1)) == (2, cores())
    for value in ("0", "x", "-2"):
        monkeypatch.setenv("BENCH_JOBS", value)
        with pytest.raises(InputError, match="BENCH_JOBS must be 1 or more, or -1"):
            count_jobs()


@pytest.mark.parametrize("jobs", [0, -2])
def test_an_invalid_number_of_jobs_is_refused(jobs):
    with pytest.raises(InputError, match="jobs must be 1 or more, or -1"):
        count_jobs(jobs)


def test_more_jobs_than_the_memory_can_hold_are_refused(monkeypatch):
    monkeypatch.setattr("bench.cores.total_memory", lambda: 8.0)
    assert count_jobs(16) == 16
    with pytest.raises(InputError, match=r"jobs must be at most .* here, got 1000: .* has 8"):
        count_jobs(1000)
    monkeypatch.setattr("bench.cores.cores", lambda: 64)
    assert count_jobs() == count_jobs(64) == 64
