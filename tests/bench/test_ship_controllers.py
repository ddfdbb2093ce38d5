from dataclasses import replace

import pytest

from bench.controller import ControllerConfig
from bench.presets import PRESETS, get_preset
from bench.ship_controllers import ship
from bench.trained import trained


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_controllers_of_both_seeds_of_quick_are_shipped_and_others_of_the_task_removed(
    task, shipped, tmp_path, monkeypatch
):
    quick = replace(get_preset("quick"), demos=6, controller=ControllerConfig(epochs=1))
    monkeypatch.setitem(PRESETS, "quick", quick)
    folder = tmp_path / "controllers"
    folder.mkdir()
    for name in ("door-original-old.json", "tool-original-old.json"):
        (folder / name).touch()
    one, two = ship(["door"], folder)
    assert (one.label, two.label) == ("door-original-nominal-s1", "door-original-nominal-s2")
    assert not (folder / "door-original-old.json").exists()
    assert (folder / "tool-original-old.json").exists()
    assert trained(one) is None
    monkeypatch.setattr("bench.trained.SHIPPED", folder)
    assert trained(one).weights != trained(two).weights
