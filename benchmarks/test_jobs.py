"""Two jobs of one run, against two runs side by side."""

import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import count
from pathlib import Path

import bench
from bench.presets import get_preset

STUDY = replace(
    get_preset("smoke"),
    tasks=("relocation",),
    methods=("kodex",),
    episodes={"success": 200, "ood": 200},
)
HALF = """
import sys
from dataclasses import replace
import bench
from benchmarks.test_jobs import STUDY
if __name__ == "__main__":
    half = replace(STUDY, episodes={sys.argv[1]: STUDY.episodes[sys.argv[1]]})
    bench.run(half, sys.argv[2], jobs=1)
"""


def test_two_jobs(compare, tmp_path):
    """The halves are the two splits, KODex and the expert on each; what both learn is there."""
    learnt, numbers = tmp_path / "learnt", count()
    bench.run(replace(STUDY, episodes=dict.fromkeys(STUDY.episodes, 1)), learnt, jobs=1)

    def fresh() -> Path:
        return shutil.copytree(learnt, tmp_path / str(next(numbers)))

    def together() -> None:
        bench.run(STUDY, fresh(), jobs=2)

    def side_by_side() -> None:
        root = Path(__file__).parents[1]
        halves = [
            subprocess.Popen([sys.executable, "-c", HALF, split, fresh()], cwd=root)
            for split in STUDY.episodes
        ]
        assert [half.wait() for half in halves] == [0, 0]

    compare("jobs_scaling", ours=together, peer=side_by_side, target=0.95)
