"""The clock of a run, against a run that is simulated job by job."""

import heapq
import time

import pytest

from bench.clock import Clock, counted, duration, headline, schedule, since_start
from bench.costs import Cost
from tasks.data import generator

PHASES = {
    "controllers": [Cost("controller", 10.0)] * 4,
    "fits": [Cost(f"fit {name}", 10.0 * size) for size in (1, 2, 9) for name in "abc"],
    "evaluations": [Cost("episodes of door", 8.0), Cost("episodes of tool", 40.0)] * 20,
}


def simulate(clock, jobs, truth, at=0.1):
    """Runs PHASES as a backend does; returns the time in all, and the clock's estimate of it.

    Args:
        clock: is told what happens.
        jobs: how many run at a time.
        truth: by kind, how many times its price a job takes.
        at: share of the time in all at which the estimate is made.
    """

    def run(tell):
        now = 0.0
        for name, costs in PHASES.items():
            took = [truth[cost.kind] * cost.seconds for cost in costs]
            tell(now, lambda name=name, costs=costs: clock.begin("", name, costs))
            waiting, running = list(range(len(costs))), []
            while waiting or running:
                while waiting and len(running) < jobs:
                    index = waiting.pop(0)
                    heapq.heappush(running, (now + took[index], index))
                    tell(now, lambda i=index, n=now: clock.start(i, f"job {i}", n))
                now, index = heapq.heappop(running)
                tell(now, lambda i=index, s=took[index], n=now: clock.end(i, s, n))
        return now

    total = run(lambda now, event: None)
    when = at * total

    def until(now, event):
        if now <= when:
            event()

    clock.expect("", PHASES)
    run(until)
    return total, when + clock.left(when)


def of_kinds(spread=0.0, common=1.0):
    rng = generator("test clock", str(spread))
    kinds = sorted({cost.kind for costs in PHASES.values() for cost in costs})
    return {kind: common * float(rng.uniform(1 - spread, 1 + spread)) for kind in kinds}


@pytest.mark.parametrize("jobs", [1, 2, 5, 100])
def test_costs_that_are_right_give_the_right_time_from_the_beginning(jobs):
    for at in (0.0, 0.1, 0.5, 0.9):
        total, estimate = simulate(Clock(jobs, 0.0), jobs, of_kinds(), at)
        assert estimate == pytest.approx(total, rel=0.02)


@pytest.mark.parametrize("common", [0.3, 1.0, 3.0])
@pytest.mark.parametrize("spread", [0.0, 0.25])
@pytest.mark.parametrize("jobs", [1, 2, 4])
def test_after_a_tenth_the_estimate_is_within_30_per_cent_of_the_truth(jobs, spread, common):
    total, estimate = simulate(Clock(jobs, 0.0), jobs, of_kinds(spread, common))
    assert estimate == pytest.approx(total, rel=0.3)


def test_the_factor_of_the_machine_counts_before_any_job_has_ended():
    clock = Clock(1, 0.0, factor=2.0)
    clock.expect("", {"fits": [Cost("fit a", 10.0)] * 3})
    assert clock.left(0.0) == 60


def test_the_first_job_of_an_unknown_kind_prices_the_rest():
    clock = Clock(1, 0.0)
    clock.expect("", {"fits": [Cost("fit mine", 1.0, known=False)] * 4})
    clock.begin("", "fits", [Cost("fit mine", 1.0, known=False)] * 4)
    clock.start(0, "first", 0.0)
    clock.end(0, 100.0, 100.0)
    assert clock.left(100.0) == pytest.approx(300)


def test_a_running_job_counts_with_its_time_and_a_late_one_raises_the_price_of_its_kind():
    clock = Clock(1, 0.0)
    costs = [Cost("fit a", 10.0)] * 2
    clock.expect("", {"fits": costs})
    clock.begin("", "fits", costs)
    clock.start(0, "first", 0.0)
    assert clock.left(4.0) == pytest.approx(16)
    assert clock.left(100.0) > 50


def test_phases_with_nothing_to_do_are_passed_by_and_new_sizes_replace_what_was_expected():
    clock = Clock(1, 0.0)
    cost = Cost("fit a", 10.0)
    clock.expect("sizes", {"controllers": [cost], "fits": [cost] * 2})
    clock.expect("then", {"controllers": [], "fits": [cost] * 7})
    assert clock.left(0.0) == 100
    clock.begin("sizes", "fits", [cost])  # the controller was shipped
    clock.start(0, "one", 0.0)
    clock.end(0, 10.0, 10.0)
    clock.begin("then", "fits", [cost] * 3)
    assert clock.left(10.0) == pytest.approx(30)
    assert counted(clock.state(10.0)) == ["sizes: fits 1/1", "then: fits 0/3"]


def test_fits_of_a_group_that_failed_together_are_counted_one_by_one():
    clock = Clock(2, 0.0)
    group, one = Cost("fit a", 50.0, count=5), Cost("fit a", 10.0)
    clock.expect("", {"fits": [group]})
    clock.begin("", "fits", [group])
    clock.start(0, "a-s1,2,3,4,5", 0.0)
    clock.split(0, 1.0)
    assert not clock.phase_over
    assert counted(clock.state(1.0)) == ["fits 0/5"]
    clock.begin("", "fits", [one] * 5)
    for index in range(5):
        clock.start(index, f"a-s{index}", 1.0)
        clock.end(index, 10.0, 11.0, failed=index == 3)
    assert clock.phase_over
    assert counted(clock.state(60.0)) == ["fits 4/5, 1 failed"]


def test_a_job_that_is_tried_again_starts_again():
    clock = Clock(1, 0.0)
    clock.expect("", {"fits": [Cost("fit a", 10.0)]})
    clock.begin("", "fits", [Cost("fit a", 10.0)])
    clock.start(0, "one", 0.0)
    clock.start(0, "one", 9.0)
    assert clock.state(9.0)["now"] == [{"label": "one", "seconds": 0.0}]
    assert clock.left(9.0) == pytest.approx(10)


def test_a_job_waits_for_those_that_run():
    assert schedule([5.0, 5.0], 2, [3.0, 1.0]) == 8
    assert schedule([], 1, [3.0, 4.0]) == 4
    assert schedule([], 3) == 0


def test_times_are_told_in_words():
    assert [duration(s) for s in (3, 119, 120, 7300)] == ["3 s", "119 s", "2 min", "2 h"]
    state = {"gone": 360, "left": 840}
    assert headline(state) == "6 min gone, about 14 min left (20 min in all)"


def test_a_command_took_what_has_passed_since_its_process_started(monkeypatch):
    monkeypatch.setattr("psutil.Process.create_time", lambda process: time.time() - 500.0)
    assert since_start() > 499.0
