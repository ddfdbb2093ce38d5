import shutil

import numpy as np
import pandas as pd
import pytest
from safetensors.numpy import load, save

from bench.results import Results
from bench.results_writer import writing
from bench.same_bits import episodes_differ, weights_differ
from bench.verify import stored_fit

WEIGHTS = {"bias": np.zeros(3, np.float32), "koopman": np.ones((2, 3))}


def weights(**changes):
    return save(WEIGHTS | changes)


def test_the_first_weight_that_differs_is_named():
    other = WEIGHTS["koopman"].copy()
    other[1, 2] = np.nextafter(1.0, 2.0)
    assert weights_differ(weights(), weights()) == ""
    found = weights_differ(weights(), weights(koopman=other))
    assert found == "koopman[1, 2] is 1.0 in one, 1.0000000000000002 in the other"
    found = weights_differ(weights(), weights(bias=np.zeros(3)))
    assert found == "bias is float32 (3,) in one, float64 (3,) in the other"
    assert weights_differ(weights(), save({"bias": WEIGHTS["bias"]})) == (
        "only one of them has koopman"
    )


def episodes(count, **changes):
    readings = np.full((count, 2), np.nan, np.float32)
    readings[:, 0] = np.arange(count)
    columns = {"success": np.ones(count, bool), "readings": readings} | changes
    return pd.DataFrame({name: list(values) for name, values in columns.items()})


def test_the_first_episode_that_differs_is_named():
    readings = np.full((4, 2), np.nan, np.float32)
    readings[:, 0] = [0, 1, 2.5, 4]
    assert episodes_differ(episodes(4), episodes(4)) == ""
    found = episodes_differ(episodes(4), episodes(4, readings=readings))
    assert found == "readings[0] of episode 2 is 2.0 in one, 2.5 in the other"
    found = episodes_differ(episodes(4), episodes(4, success=[True, False, True, True]))
    assert found == "success of episode 1 is True in one, False in the other"


def test_only_whole_chunks_are_compared_where_one_has_more_episodes():
    other = episodes(4, success=[True, False, True, True])
    assert episodes_differ(episodes(6), other) == ""


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_fits_whose_bits_must_be_the_same_are_not_merged_if_they_differ(
    task, smoke, bench, tmp_path
):
    one, other, out = (tmp_path / name for name in ("one", "other", "out"))
    bench("run", "smoke", "--out", str(one), "--jobs", "1")
    shutil.copytree(one, other)
    results = Results(one)
    rows = results.frame().to_dict("records")
    fit = stored_fit(next(row for row in rows if row["method"] == "kodex"))
    changed = load(results.parameters(fit))
    changed["koopman"][0, 0] += 1
    with writing(other) as writer:
        writer.add_fit(fit, save(changed), b"", results.fit_facts(fit))
    code, _, error = bench("merge", str(one), str(other), "--out", str(out))
    assert code == 2
    assert f"{other} and a folder before it differ in what must have the same bits" in error
    assert "koopman[0, 0] is" in error
