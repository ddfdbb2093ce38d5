"""How well the jobs of the preset `paper` use workers, by their measured costs."""

import pytest

from bench.agenda import make_agenda
from bench.job_queue import finishing_time
from bench.plan import queue_of
from bench.presets import get_preset
from bench.results import Results
from bench.study_demos import demos_keys_of


def seconds(job):
    return job.cost.seconds


@pytest.mark.parametrize("workers", [2, 16, 128])
def test_the_schedule_of_paper_is_within_10_per_cent_of_the_shortest(
    workers, tmp_path, monkeypatch, figure
):
    monkeypatch.setattr("bench.cores.cores", lambda: workers)
    monkeypatch.setattr("bench.plan.trained", lambda spec: None)
    study, results = get_preset("paper"), Results(tmp_path)
    queue = queue_of(make_agenda(study, demos_keys_of(study), results), results, workers)
    total = sum(map(seconds, queue.waiting))
    least = max(total / workers, queue.longest_chain(seconds))
    made = finishing_time(queue.waiting, workers, seconds)
    figure(f"time over the least with {workers} workers", made / least)
    assert made <= 1.1 * least
