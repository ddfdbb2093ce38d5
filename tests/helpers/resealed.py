"""Changes submitted files and packed results, and seals them again, as a forger would."""

import json

import pyarrow as pa
import pyarrow.parquet as pq

from bench.names import KEY_DIGITS, fit_key
from bench.packed import EPISODES, EVALUATIONS, PROVENANCE
from bench.sealed_files import seal_folder, seal_table
from bench.source import FIT_FIELDS
from bench.stored_files import DIAGNOSTICS
from bench.submission import LABEL


def pack_evaluations(folder, frame):
    """Gives packed results, which may hold nothing yet, these evaluations."""
    path = folder / PROVENANCE
    facts = json.loads(path.read_bytes()) if path.exists() else {"notes": []}
    kept = [folder / name for name in (EPISODES, DIAGNOSTICS)]
    contents = {path.name: path.read_bytes() for path in kept if path.exists()}
    contents[EVALUATIONS] = frame.to_parquet(index=False)
    facts = {name: facts[name] for name in facts if name not in ("self", "sha256", "format")}
    for name, content in seal_folder(PROVENANCE, facts, contents).items():
        (folder / name).write_bytes(content)


def record_of(file):
    """Returns the record of a file."""
    return json.loads(pq.read_schema(file).metadata[LABEL.encode()])


def reseal(file, change):
    """Changes the record and the episodes of a file, and seals it again."""
    table, record = pq.read_table(file), record_of(file)
    episodes = change(record, table.to_pandas())
    again = pa.Table.from_pandas(episodes, table.schema.remove_metadata(), preserve_index=False)
    file.write_bytes(seal_table(again, {LABEL: json.dumps(record)}))


def rekey(record, row, label):
    """Gives a row the key of its changed fields."""
    key = fit_key(record["version"], {name: row[name] for name in FIT_FIELDS})
    folder = f"{label}-{key[:KEY_DIGITS]}"
    record["fits"][folder] = record["fits"][row["folder"]]
    row["folder"] = folder


def flip(record, episodes):
    return episodes.assign(success=episodes.success ^ (episodes.index == 3))


def flip_and_count(record, episodes):
    before, episodes = episodes, flip(record, episodes)
    record["evaluations"][0]["successes"] += int(episodes.success.sum() - before.success.sum())
    return episodes


def swap_seeds(record, episodes):
    first, second = record["evaluations"]
    first["seed"], second["seed"] = second["seed"], first["seed"]
    return episodes


def swap_seeds_and_keys(record, episodes):
    episodes = swap_seeds(record, episodes)
    for row in record["evaluations"]:
        rekey(record, row, f"{row['folder'].rpartition('-s')[0]}-s{row['seed']}")
    return episodes


def name_another_controller(record, episodes):
    for row in record["evaluations"]:
        record["controllers"]["f" * 64] = record["controllers"][row["controller_key"]]
        row["controller_key"] = "f" * 64
    return episodes


def train_controllers_longer(record, episodes):
    for spec in record["controllers"].values():
        spec["config"]["epochs"] = 999
    return episodes


def drop_a_seed(record, episodes):
    record["evaluations"].pop()
    return episodes[episodes.evaluation == 0]


def choose_starts(record, episodes):
    return episodes.assign(start=episodes.start + 1)


def learn_from_other_demonstrations(record, episodes):
    for row in record["evaluations"]:
        row["demos_key"] = "e" * 64
        rekey(record, row, row["folder"].rpartition("-")[0])
    return episodes


def take_weights_from_a_file(record, episodes):
    for row in record["evaluations"]:
        row["weights"] = "a" * 64
        rekey(record, row, row["folder"].rpartition("-")[0])
    return episodes


def leave_out_what_it_has(record, episodes):
    record["missing"] = ["door"]
    return episodes


def claim_the_name_of_the_suite(record, episodes):
    record["method"] = "nn"
    for row in record["evaluations"]:
        row["method"] = "nn"
        rekey(record, row, f"door-nn-s{row['seed']}")
    return episodes
