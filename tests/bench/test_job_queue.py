"""The order of jobs: needs are met, long chains go first, failures drop only dependent jobs."""

from dataclasses import dataclass

import pytest
from fake_jobs import FakeJob, job
from hypothesis import given
from hypothesis import strategies as st

from bench.job_queue import JobQueue, finishing_time, name_of


def seconds(one):
    return one.cost.seconds


def taken(queue):
    """The names of the jobs that can start now, in order."""
    names = []
    while found := queue.take():
        names.append(name_of(found))
    return names


def test_a_job_starts_once_all_results_it_needs_exist():
    queue = JobQueue([job("fit"), job("controller"), job("tested", needs=("fit", "controller"))])
    assert set(taken(queue)) == {"fit", "controller"}
    assert queue.blocked
    queue.finish("fit")
    assert not queue.ready
    queue.finish("controller")
    assert taken(queue) == ["tested"]
    assert not queue.blocked


def test_a_result_that_no_job_makes_counts_as_existing():
    assert taken(JobQueue([job("tested", needs=("stored",))])) == ["tested"]


def test_the_job_with_the_longest_chain_goes_first():
    queue = JobQueue(
        [job("long", 5), job("short", 1), job("then", 9, needs=("short",)), job("tiny", 0.5)]
    )
    assert taken(queue) == ["short", "long", "tiny"]


def test_a_failed_result_drops_jobs_that_need_it_but_not_those_after_it():
    jobs = [
        job("fit"),
        job("tested", needs=("fit",)),
        job("reported", needs=("tested",)),
        job("chosen", after=("tested",)),
    ]
    queue = JobQueue(jobs)
    queue.take()
    queue.fail("fit")
    assert taken(queue) == ["chosen"]
    queue.add([job("fit"), job("tested", needs=("fit",)), job("other")])
    assert taken(queue) == ["other"]


@dataclass(frozen=True)
class Tuned(FakeJob):
    """Controllers of several seeds, each tuned from that of its seed."""

    def parts(self):
        pairs = zip(self.makes, self.needs, strict=True)
        return [Tuned((made,), needs=(need,)) for made, need in pairs]


def test_a_failed_seed_drops_the_jobs_of_no_other_seed_that_train_beside_it():
    seeds = range(1, 4)
    tuned = Tuned(tuple(f"t{s}" for s in seeds), needs=tuple(f"o{s}" for s in seeds))
    tests = [job(f"e{s}", needs=(f"t{s}",)) for s in seeds]
    queue = JobQueue([*(job(f"o{s}") for s in seeds), tuned, *tests])
    queue.take("o2")
    queue.fail("o2")
    assert queue.failed == {"o2", "t2", "e2"}
    queue.add([tuned, *tests])  # as a later request for the same results
    for made in ("o1", "o3", "t1", "t3", "e1", "e3"):
        queue.take(made)
        queue.finish(made)
    assert not queue.waiting


def test_a_result_is_made_by_one_job_only():
    queue = JobQueue([job("controller")])
    queue.take()
    queue.add([job("controller")])
    assert not queue.waiting


def test_a_job_that_fails_is_replaced_by_its_parts():
    queue = JobQueue([job("s1 s2 s3", 30)])
    queue.take()
    assert queue.divide("s1")
    assert sorted(one.makes for one in queue.waiting) == [("s1", "s2"), ("s3",)]
    assert taken(queue) == ["s1", "s3"]
    assert not queue.divide("s3")


@pytest.mark.parametrize("workers", [1, 2, 16])
def test_long_jobs_are_divided_until_no_worker_waits_for_them(workers):
    queue = JobQueue([job("s1 s2 s3 s4 s5 s6 s7 s8", 80), *(job(f"f{i}", 1) for i in range(20))])
    queue.divide_long(workers)
    total = sum(map(seconds, queue.waiting))
    assert total == 100
    bound = max(total / workers, 10.0)  # one seed takes ten seconds
    assert finishing_time(queue.waiting, workers, seconds) <= 1.2 * bound
    if workers == 1:
        assert len(queue.waiting) == 21


def test_running_jobs_count_with_their_remaining_time():
    jobs = [job("a", 5), job("b", 5), job("c", 3), job("d", 1)]
    assert finishing_time(jobs, 2, seconds, {"c": 3.0, "d": 1.0}) == 8
    assert finishing_time(jobs[2:], 1, seconds, {"c": 3.0, "d": 4.0}) == 4
    assert finishing_time([], 3, seconds) == 0


@st.composite
def studies(draw):
    """Controllers, fits, and evaluations that need one of each."""
    times = st.floats(0.1, 100)
    controllers = [job(f"c{i}", draw(times)) for i in range(draw(st.integers(1, 3)))]
    fits = [job(f"f{i}", draw(times)) for i in range(draw(st.integers(1, 8)))]
    tests = []
    for i in range(draw(st.integers(0, 20))):
        needs = draw(st.sampled_from(controllers)), draw(st.sampled_from(fits))
        tests.append(job(f"e{i}", draw(times), needs=tuple(map(name_of, needs))))
    return [*controllers, *fits, *tests]


@given(studies(), st.integers(1, 20))
def test_a_schedule_takes_at_most_the_work_per_worker_and_the_longest_chain(jobs, workers):
    """Graham's bound holds for any schedule in which no worker waits while a job is ready."""
    total, chain = sum(map(seconds, jobs)), JobQueue(jobs).longest_chain(seconds)
    made = finishing_time(jobs, workers, seconds)
    assert max(total / workers, chain) - 1e-6 <= made <= total / workers + chain + 1e-6


@given(studies(), st.integers(1, 5), st.integers(0, 10))
def test_every_job_ends_unless_it_needs_a_failed_result(jobs, workers, failing):
    queue, done = JobQueue(jobs), set()
    bad = name_of(jobs[failing % len(jobs)])
    while running := [found for _ in range(workers) if (found := queue.take())]:
        for one in running:
            if name_of(one) == bad:
                queue.fail(bad)
            else:
                assert set(one.needs) <= done
                queue.finish(name_of(one))
                done.add(name_of(one))
    assert not queue.waiting
    lost = {name_of(one) for one in jobs if bad in (*one.needs, *one.makes)}
    assert done == {name_of(one) for one in jobs} - lost
