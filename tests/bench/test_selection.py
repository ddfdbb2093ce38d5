"""The sizes that a study compares, and the size that it chooses."""

from dataclasses import replace

import pandas as pd
import pytest

from bench.experiments import cells_of
from bench.presets import get_preset
from bench.selection import best_size, chosen_sizes
from methods.registry import TO_BEAT
from tasks.errors import InputError


def test_a_method_without_the_named_sizes_is_compared_at_all_its_sizes():
    study = replace(get_preset("quick"), sizes=("large",))
    cells = cells_of(study, dict.fromkeys(study.tasks, "key"))
    sizes = {(cell.fit.method, cell.fit.size) for cell in cells}
    of_one_size = {"kodex", *TO_BEAT}
    assert {(name, "single") for name in of_one_size} <= sizes
    assert {size for name, size in sizes if name not in {"expert", *of_one_size}} == {"large"}
    with pytest.raises(InputError, match="'single'; methods that have it: kodex, nearest, regr"):
        cells_of(replace(study, methods=("nn",), sizes=("single",)), {})


def test_the_best_size_on_validation_starts_is_chosen_and_the_first_of_equals():
    study = replace(get_preset("paper"), tasks=("door",), methods=("kodex", "nn", "lstm"))
    rows = [("nn", "small", 1, 10), ("nn", "small", 2, 20), ("nn", "median", 1, 25)]
    rows += [("nn", "median", 2, 5), ("nn", "large", 1, 14), ("lstm", "large", 1, 3)]
    frame = pd.DataFrame(rows, columns=["method", "size", "seed", "successes"]).assign(
        task="door", split="validation", variant="described", demos=200, episodes=50, expert="first"
    )
    other = frame.assign(split="test", successes=50)
    chosen = chosen_sizes(study, pd.concat([other, frame]))
    assert chosen == {("door", "nn"): "small", ("door", "lstm"): "large"}


def test_the_order_of_seeds_does_not_change_the_chosen_size():
    rows = [("small", n) for n in (42, 41, 38, 43, 39)]
    rows += [("median", n) for n in (42, 42, 39, 40, 40)]
    frame = pd.DataFrame(rows, columns=["size", "successes"]).assign(episodes=50)
    rates = (frame.successes / frame.episodes).groupby(frame["size"]).mean()
    assert rates["small"] < rates["median"]
    assert best_size(frame, ["small", "median"]) == "small"
