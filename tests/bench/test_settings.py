"""Settings of a study: which are accepted, and which are refused."""

from dataclasses import replace

import pytest

from bench.experiments import cells_of
from bench.parsing import settings
from bench.presets import get_preset
from tasks.errors import InputError


@pytest.mark.parametrize(
    ("place", "value", "experiment"),
    [
        (("kodex", "observables"), 2, "lifting"),
        (("lstm", "teacher_forced"), True, "variants"),
        (("ndp", "hidden"), [8], "sizes"),
    ],
)
def test_a_field_that_an_experiment_compares_cannot_be_set(place, value, experiment):
    preset = get_preset("audit" if experiment == "variants" else "paper")
    study = replace(preset, settings={place: value})
    with pytest.raises(InputError, match=f"is what {experiment} compares"):
        cells_of(study, dict.fromkeys(study.tasks, "key"))
    others = {name: 10 for name in study.episodes if name != experiment}
    assert cells_of(replace(study, episodes=others), dict.fromkeys(study.tasks, "key"))


def test_a_whole_number_may_be_set_with_an_exponent():
    study = replace(get_preset("smoke"), methods=("nn",), settings=settings(["nn.epochs=1e3"]))
    configs = [cell.fit.config for cell in cells_of(study, {"door": "key"})]
    assert {repr(config["epochs"]) for config in configs if config} == {"1000"}


@pytest.mark.parametrize(
    ("name", "field"), [("kodex", "cutoff"), ("ndp", "goal_gain"), ("ndp", "weight_gain")]
)
def test_a_whole_number_is_the_same_setting_as_a_float(name, field):
    def keys(value):
        study = replace(get_preset("smoke"), methods=(name,), settings={(name, field): value})
        return [cell.fit.key for cell in cells_of(study, {"door": "key"})]

    assert keys(1) == keys(1.0)


def test_a_setting_must_be_known_to_every_variant_that_is_fitted():
    study = replace(get_preset("audit"), settings={("ngf", "window"): 5})
    keys = dict.fromkeys(study.tasks, "key")
    with pytest.raises(InputError, match="unknown config field of ngf as published 'window'"):
        cells_of(study, keys)
    assert cells_of(replace(study, variants=("described",)), keys)
    episodes = {name: n for name, n in study.episodes.items() if name != "variants"}
    assert cells_of(replace(study, episodes=episodes), keys)


@pytest.mark.parametrize("given", ["nn.epochs=5,1e1,20", {"nn.epochs": [5, 10, 20]}])
def test_several_values_give_a_fit_each(given):
    chosen = settings([given] if isinstance(given, str) else given)
    study = replace(get_preset("smoke"), methods=("nn",), expert=False, settings=chosen)
    cells = cells_of(study, {"door": "key"})
    assert sorted({cell.fit.config["epochs"] for cell in cells}) == [5, 10, 20]
    assert {cell.fit.settings for cell in cells} == {"epochs=5", "epochs=10", "epochs=20"}
    assert len({cell.fit.key for cell in cells}) == 3


def test_values_of_two_fields_are_combined_and_a_default_is_the_plain_row():
    chosen = settings(["nn.epochs=2,3", "nn.batch_size=32,64"])
    study = replace(get_preset("smoke"), methods=("nn",), expert=False, settings=chosen)
    labels = {cell.fit.settings for cell in cells_of(study, {"door": "key"})}
    assert labels == {
        "epochs=3",
        "batch_size=64+epochs=3",
        "",  # smoke trains for two epochs anyway
        "batch_size=64",
    }


def test_a_list_of_numbers_for_a_tuple_stays_one_value():
    study = replace(
        get_preset("smoke"), methods=("ngf",), expert=False, settings=settings(["ngf.hidden=8,4"])
    )
    study = replace(study, episodes={"success": 5})
    cells = cells_of(study, {"door": "key"})
    assert {tuple(cell.fit.config["hidden"]) for cell in cells} == {(8, 4)}


def test_a_list_with_one_wrong_value_is_refused():
    study = replace(get_preset("smoke"), methods=("nn",), settings=settings(["nn.epochs=5,few"]))
    with pytest.raises(InputError, match=r"nn\.epochs takes int, got 'few'"):
        cells_of(study, {"door": "key"})
