"""Any input of a user is accepted or refused with an InputError; --times sets the effort."""

import json
import shutil
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.cli_status import progress
from bench.experiments import cells_of
from bench.presets import PRESETS
from bench.sealed_files import seal_record
from bench.stored_files import Times
from bench.studies import Options, study_of
from methods.base import shortened
from methods.registry import get_method, method_names
from methods.toy import toy
from methods.training import TrainingError
from tasks.data import Layout
from tasks.errors import InputError
from tasks.files import from_bytes
from tasks.registry import TASKS

LAYOUT = Layout(robot_dim=3, object_dim=2, action_dim=3)
toy = partial(toy, layout=LAYOUT, horizon=15)
STUDIES = {
    "smoke": PRESETS["smoke"],
    "audit": replace(
        PRESETS["audit"], tasks=("door",), seeds=(1,), episodes={"variants": 1, "controllers": 1}
    ),
}
DEMOS_KEYS = dict.fromkeys(TASKS, "key")
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
FIELDS = sorted(
    {
        (name, field)
        for name in method_names()
        for variant in ("described", "published")
        for field in vars(next(iter(get_method(name, variant).sizes.values())))
    }
)


def understood(call):
    with suppress(InputError):
        call()


def test_any_command_line_is_accepted_or_refused(times):
    @settings(max_examples=50 * times)
    @given(
        preset=WORDS,
        names=st.tuples(*[NAMES] * 6),
        episodes=st.none() | st.integers(-5, 10**9),
        assignments=st.none() | st.lists(st.text(max_size=20), max_size=2),
    )
    def fuzz(preset, names, episodes, assignments):
        lists = dict(zip(list(Options.__annotations__)[:6], names, strict=True))
        study = partial(study_of, preset, **lists, episodes=episodes, settings=assignments)
        understood(lambda: cells_of(study(), DEMOS_KEYS))

    fuzz()


def test_any_value_of_a_config_is_accepted_or_refused(times):
    @settings(max_examples=100 * times)
    @given(preset=st.sampled_from(["smoke", "paper"]), place=st.sampled_from(FIELDS), value=VALUES)
    def fuzz(preset, place, value):
        study = replace(
            PRESETS[preset],
            methods=(place[0],),
            settings={place: json.loads(json.dumps(value))},
        )
        understood(lambda: cells_of(study, DEMOS_KEYS))

    fuzz()


@pytest.mark.parametrize("place", FIELDS, ids=".".join)
def test_a_method_can_be_fitted_with_any_accepted_value(place):
    for preset, value in product(("smoke", "audit"), (-1, 0, 1, 2, 0.5, [], [0], [1], [2, 1])):
        study = replace(STUDIES[preset], methods=(place[0],), settings={place: value})
        try:
            fits = [cell.fit for cell in cells_of(study, DEMOS_KEYS)]
        except InputError:
            continue
        for fit in {fit.key: fit for fit in fits if fit.method != "expert"}.values():
            config = shortened(fit.build().config, 2)
            with suppress(TrainingError):
                get_method(fit.method, fit.variant)(config, LAYOUT).fit(toy(0, 3), toy(3, 2), 1)


def spliced(content, place, values):
    """Replaces some bytes by as many others."""
    place %= len(content)
    return content[:place] + values + content[place + len(values) :]


def resealed(content, place, value):
    """A record with a changed value and a matching digest."""
    record = json.loads(content)
    record.pop("self")
    *outer, last = (paths := list(paths_in(record)))[place % len(paths)]
    inner = record
    for name in outer:
        inner = inner[name]
    inner[last] = value
    return seal_record(record)


def paths_in(record, above=()):
    """The path of every value in nested dictionaries."""
    for name, inner in record.items():
        yield (*above, name)
        if isinstance(inner, dict):
            yield from paths_in(inner, (*above, name))


def test_any_stored_file_is_read_or_set_aside_or_refused(stored, tmp_path, times, capsys):
    writer = stored.writer
    writer.add_times(stored.results.frame().folder[0], Times([1.0]))
    writer.add_failure("label", "reason", "traceback")
    results = writer.results
    paths = [path for path in sorted(writer.folder.rglob("*")) if path.is_file()]
    before = {path: path.read_bytes() for path in paths if path.name != ".lock"}
    assert len(before) == 7

    @settings(max_examples=50 * times, suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(
        path=st.sampled_from(list(before)),
        kind=st.sampled_from(["bytes", "json", "spliced", "resealed"]),
        place=st.integers(0, 10**6),
        raw=st.binary(max_size=40),
        value=VALUES,
    )
    def fuzz(path, kind, place, raw, value):
        content = {
            "bytes": lambda: raw,
            "json": lambda: json.dumps(value).encode(),
            "spliced": lambda: spliced(before[path], place, raw),
            "resealed": lambda: (
                resealed(before[path], place, value) if path.suffix == ".json" else raw
            ),
        }[kind]()
        for one, sound in before.items():
            one.parent.mkdir(parents=True, exist_ok=True)
            one.write_bytes(sound)
        path.write_bytes(content)
        for read in (results.frame, results.failures, lambda: progress(results)):
            understood(read)
        understood(lambda: list(results.non_finite()))
        understood(lambda: from_bytes(results.parameters(stored.fit)))
        understood(lambda: results.episodes(stored.wanted))
        understood(writer.set_aside_damage)
        understood(lambda: writer.ask_for([stored.wanted]))
        assert [one.name for one in tmp_path.iterdir()] == ["results"]
        shutil.rmtree(writer.folder / "damaged", ignore_errors=True)
        capsys.readouterr()

    fuzz()
