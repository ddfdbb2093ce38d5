"""The clock of a run, compared with a run that is simulated job by job."""

import heapq

import pytest
from fake_jobs import job

from bench.clock import Clock, counted, duration, headline
from bench.job_queue import JobQueue, name_of
from tasks.data import generator


def study():
    """Four controllers, nine fits and 120 evaluations of two tasks."""
    controllers = [job(f"c{i}", 10, kind="controllers", cost_kind="controller") for i in range(4)]
    fits = [
        job(f"f{name}{size}", 10.0 * size, cost_kind=f"fit {name}")
        for size in (1, 2, 4)
        for name in "abc"
    ]
    tests = [
        job(
            f"e{i}",
            40.0 if i % 2 else 8.0,
            needs=(name_of(fits[i % 9]), name_of(controllers[i % 4])),
            kind="evaluations",
            cost_kind=f"episodes {i % 2}",
        )
        for i in range(120)
    ]
    return [*controllers, *fits, *tests]


def simulate(workers, truth, at=0.1):
    """Runs the study; returns the time in all, and the clock's estimate of it.

    Args:
        workers: jobs at a time.
        truth: by kind of cost, how many times its price a job takes.
        at: share of the time in all at which the estimate is made.
    """

    def run(until):
        queue = JobQueue(study())
        clock, now, running = Clock(queue, workers, 0.0), 0.0, []
        while True:
            while len(running) < workers and (one := queue.take()):
                clock.start(one, now)
                took = truth[one.cost.kind] * one.cost.seconds
                heapq.heappush(running, (now + took, name_of(one), took))
            if not running or running[0][0] > until:
                return now, clock
            now, name, took = heapq.heappop(running)
            one = queue.running[name]
            queue.finish(name)
            clock.end(one, took, now)

    total, _ = run(float("inf"))
    when = at * total
    return total, when + run(when)[1].left(when)


def of_kinds(spread=0.0, common=1.0):
    rng = generator("test clock", str(spread))
    kinds = sorted({one.cost.kind for one in study()})
    return {kind: common * float(rng.uniform(1 - spread, 1 + spread)) for kind in kinds}


@pytest.mark.parametrize("workers", [1, 2, 5, 100])
def test_correct_costs_give_the_correct_time_from_the_start(workers):
    for at in (0.0, 0.1, 0.5, 0.9):
        total, estimate = simulate(workers, of_kinds(), at)
        assert estimate == pytest.approx(total, rel=0.02)


@pytest.mark.parametrize("common", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("spread", [0.0, 0.25])
@pytest.mark.parametrize("workers", [1, 2, 4])
def test_after_a_tenth_of_a_run_the_estimate_is_within_30_per_cent(workers, spread, common):
    total, estimate = simulate(workers, of_kinds(spread, common))
    assert estimate == pytest.approx(total, rel=0.3)


def test_the_machine_factor_applies_until_jobs_have_ended():
    queue = JobQueue([job(name, 10) for name in "abc"])
    assert Clock(queue, 1, 0.0, factor=2.0).left(0.0) == 60


def test_the_first_job_of_an_unknown_kind_prices_the_rest():
    queue = JobQueue([job(name, known=False) for name in "abcd"])
    clock = Clock(queue, 1, 0.0)
    first = queue.take()
    clock.start(first, 0.0)
    queue.finish(name_of(first))
    clock.end(first, 100.0, 100.0)
    assert clock.left(100.0) == pytest.approx(300)


def test_a_late_job_raises_the_price_of_its_kind():
    queue = JobQueue([job(name, 10) for name in "ab"])
    clock = Clock(queue, 1, 0.0)
    clock.start(queue.take(), 0.0)
    assert clock.left(4.0) == pytest.approx(16)
    assert clock.left(100.0) > 50


def test_failed_results_are_counted_separately():
    queue = JobQueue([job("s1 s2", 20), job("e1", needs=("s1",), kind="evaluations")])
    clock = Clock(queue, 2, 0.0)
    pair = queue.take()
    clock.start(pair, 0.0)
    queue.divide("s1")
    clock.end(pair, 1.0, 1.0, failed=True)
    assert counted(clock.state(1.0)) == "fits 0/2, evaluations 0/1"
    for fails in (True, False):
        one = queue.take()
        clock.start(one, 1.0)
        if fails:
            queue.fail(name_of(one))
        else:
            queue.finish(name_of(one))
        clock.end(one, 10.0, 11.0, failed=fails)
    assert clock.over
    assert counted(clock.state(60.0)) == "fits 1/2 (1 failed)"


def test_the_time_of_a_retried_job_starts_again():
    queue = JobQueue([job("one", 10)])
    clock = Clock(queue, 1, 0.0)
    one = queue.take()
    clock.start(one, 0.0)
    clock.start(one, 9.0)
    assert clock.state(9.0)["now"] == [{"label": "one", "seconds": 0.0}]
    assert clock.left(9.0) == pytest.approx(10)


def test_a_job_that_waits_for_a_worker_does_not_count_as_running():
    queue = JobQueue([job("one", 10), job("two", 10)])
    clock = Clock(queue, 1, 0.0)
    one, two = queue.take(), queue.take()
    clock.start(one, 0.0)
    clock.start(two, 0.0)
    assert [entry["label"] for entry in clock.state(5.0)["now"]] == ["one"]
    queue.finish("one")
    clock.end(one, 10.0, 10.0)
    assert clock.state(15.0)["now"] == [{"label": "two", "seconds": 5.0}]


def test_durations_are_printed_in_fitting_units():
    assert [duration(s) for s in (3, 119, 120, 7300)] == ["3 s", "119 s", "2 min", "2 h"]
    state = {"gone": 360, "left": 840}
    assert headline(state) == "6 min gone, about 14 min left (20 min in all)"
