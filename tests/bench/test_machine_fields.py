"""Fields of a config that say where a method computes, such as a device."""

from dataclasses import dataclass, field, replace

import pytest

from bench.experiments import cells_of
from bench.presets import get_preset
from bench.results import Results
from methods.checks import DECLARED, RULES
from methods.contract import build, resolved
from methods.description import describe_method, stand_in
from methods.nearest import Nearest
from methods.toy import LAYOUT


@dataclass(frozen=True)
class Config:
    neighbours: int = 1
    device: str = field(default="cpu", metadata={"of_machine": True})


@dataclass(frozen=True)
class WithoutDevice:
    neighbours: int = 1


@dataclass(frozen=True)
class WithoutDefault:
    device: str = field(metadata={"of_machine": True})


@pytest.fixture
def sizes(monkeypatch):
    """Gives a method of the suite other sizes."""

    def change(**sizes):
        monkeypatch.setattr(Nearest, "sizes", sizes)

    return change


def fits(**settings):
    chosen = {("nearest", name): value for name, value in settings.items()}
    study = replace(get_preset("smoke"), methods=("nearest",), expert=False, settings=chosen)
    return [cell.fit for cell in cells_of(study, {"door": "key"})]


def test_a_device_reaches_the_method_and_leaves_key_label_and_stored_config_alone(sizes):
    sizes(single=WithoutDevice())
    (before, *_) = fits()
    sizes(single=Config())
    for found in (fits(), fits(device="cpu"), fits(device="cuda")):
        assert {(fit.key, fit.label, str(fit.stored)) for fit in found} == {
            (before.key, before.label, str(before.stored))
        }
    assert {fit.build().config for fit in fits(device="cuda")} == {Config(device="cuda")}
    assert fits(device="cuda", neighbours=2)[0].settings == "neighbours=2"
    assert fits(device="cuda", neighbours=2)[0].key != before.key


@pytest.mark.parametrize("task", ["door"], indirect=True)
def test_a_run_on_another_device_computes_nothing_again(task, smoke, bench, tmp_path, sizes):
    sizes(single=Config())
    run = ("run", "smoke", "--methods", "nearest", "--experiments", "success", "--jobs", "1")
    run += ("--out", str(tmp_path))
    assert bench(*run)[1].startswith("3 results computed")
    assert bench(*run, "--set", "nearest.device=cuda")[1].startswith("0 results computed")
    (row,) = Results(tmp_path).frame().to_dict("records")
    assert row["config"] == {"neighbours": 1}
    assert bench("verify", str(tmp_path), "--jobs", "1")[0] == 0


def test_a_stored_config_gets_the_device_of_the_machine_that_reads_it(sizes):
    sizes(single=Config())
    assert build(Nearest, {"neighbours": 3}, LAYOUT).config == Config(3, "cpu")


def test_the_stand_in_of_a_package_has_the_same_device(sizes):
    sizes(single=Config())
    config = stand_in(describe_method(Nearest)).sizes["single"]
    (device,) = (one for one in type(config).__dataclass_fields__.values() if one.metadata)
    assert (device.name, device.default, dict(device.metadata)) == (
        "device",
        "cpu",
        {"of_machine": True},
    )
    assert resolved(config) == resolved(Config())


@pytest.mark.parametrize(
    "broken", [{"small": Config(), "large": Config(device="cuda")}, {"one": WithoutDefault("cpu")}]
)
def test_check_asks_for_a_device_with_a_default_that_no_size_changes(sizes, broken):
    sizes(single=Config())
    RULES[DECLARED](Nearest)
    sizes(**broken)
    with pytest.raises(Exception, match="'device' says where the method computes, so it needs a"):
        RULES[DECLARED](Nearest)
