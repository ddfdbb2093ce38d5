"""Whatever a user writes is understood or refused by InputError; --times says how thoroughly."""

import json
from contextlib import suppress
from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from bench.cli_run import _study
from bench.experiments import cells_of
from bench.presets import PRESETS
from methods.registry import get_method, method_names
from tasks.errors import InputError
from tasks.registry import TASKS

RECIPES = dict.fromkeys(TASKS, "recipe")
WORDS = st.sampled_from(
    [*PRESETS, *TASKS, *method_names(), "success", "small", "published", "1", "2,3", "0", ",", ""]
) | st.text(max_size=12)
NAMES = st.none() | WORDS | st.lists(WORDS, max_size=3).map(",".join)
VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["1e400", "../x", "__import__('os')"]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=2)
    ),
    max_leaves=4,
)
FIELDS = [
    (name, field)
    for name in method_names()
    for field in vars(next(iter(get_method(name).sizes.values())))
]


def understood(call):
    with suppress(InputError):
        call()


def test_any_command_line_is_understood_or_refused(times):
    @settings(max_examples=50 * times)
    @given(
        preset=WORDS,
        names=st.tuples(*[NAMES] * 6),
        episodes=st.none() | st.integers(-5, 10**9),
        assignments=st.none() | st.lists(st.text(max_size=20), max_size=2),
    )
    def fuzz(preset, names, episodes, assignments):
        understood(lambda: cells_of(_study(preset, *names, episodes, assignments), RECIPES))

    fuzz()


def test_any_value_of_a_config_is_understood_or_refused(times):
    @settings(max_examples=100 * times)
    @given(place=st.sampled_from(FIELDS), value=VALUES)
    def fuzz(place, value):
        study = replace(
            PRESETS["smoke"],
            methods=(place[0],),
            settings={place: json.loads(json.dumps(value))},
        )
        understood(lambda: cells_of(study, RECIPES))

    fuzz()
