"""Whether this processor computes the digests of ``same_bits.json``."""

import json

import pytest
import same_bits

from bench.provenance import software
from bench.trained import SHIPPED
from tasks.pins import pin
from tasks.registry import TASKS

SEEN = json.loads(same_bits.FILE.read_text())["seen"]
LIBRARIES = ("mujoco", "numpy", "scipy", "torch")
"""Those that compute."""


def versions(facts):
    return [facts["versions"][name] for name in LIBRARIES]


pytestmark = pytest.mark.skipif(
    bool(pin().why_not) or versions(software()) not in map(versions, SEEN),
    reason="not pinned, or other versions",
)


def test_demonstrations_and_fits_of_door_have_the_digests_of_other_processors():
    known = same_bits.expected()["door"]
    found = dict(same_bits.digests("door", controller=False))
    assert found == {name: known[name] for name in found}


@pytest.mark.long
@pytest.mark.parametrize("task", TASKS)
def test_everything_learnt_on_a_task_has_the_digests_of_other_processors(task):
    assert dict(same_bits.digests(task)) == same_bits.expected()[task]


@pytest.mark.parametrize("task", TASKS)
def test_the_shipped_controller_of_seed_1_has_the_digest_that_training_it_alone_gives(task):
    (card,) = SHIPPED.glob(f"{task}-original-nominal-s1-*.json")
    assert (
        json.loads(card.read_text())["weights_sha256"] == same_bits.expected()[task]["controller"]
    )
