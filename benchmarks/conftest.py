"""Speed as ratios: both sides run in turn, in one process, so that the machine's mood cancels."""

import json
from collections.abc import Callable
from pathlib import Path
from statistics import median
from time import perf_counter

import pytest

PAIRS = 9
RATIOS = Path(__file__).with_name("ratios.json")
_ratios: dict[str, dict[str, float]] = {}


@pytest.fixture
def compare(benchmark):
    """Measures how many times faster ours does its work than the peer does its own."""

    def run(
        name: str,
        ours: Callable[[], object],
        peer: Callable[[], object],
        target: float,
        work: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """Records the ratio of work done per second, ours over the peer's.

        Args:
            name: under which the ratio is listed.
            ours: does work[0] units of work.
            peer: does work[1] units of work.
            target: the ratio that is aimed at.
            work: units of work that one call of each does.
        """
        peers = []

        def time_peer() -> None:
            begin = perf_counter()
            peer()
            peers.append(perf_counter() - begin)

        benchmark.pedantic(ours, setup=time_peer, rounds=PAIRS, warmup_rounds=1)
        pairs = zip(benchmark.stats.stats.data, peers[-PAIRS:], strict=True)
        ratios = sorted((work[0] / t_ours) / (work[1] / t_peer) for t_ours, t_peer in pairs)
        row = {
            "ratio": round(median(ratios), 3),
            "target": target,
            "low": round(ratios[0], 3),
            "high": round(ratios[-1], 3),
            "per_second": round(work[0] / median(benchmark.stats.stats.data)),
        }
        benchmark.extra_info.update(row)
        _ratios[name] = row
        _write(name, row)

    return run


def _write(name: str, row: dict[str, float]) -> None:
    """Adds a ratio to the file; of ``name[case]``, the worst case also stands under the name."""
    known = json.loads(RATIOS.read_text()) if RATIOS.exists() else {}
    known[name] = row
    family = name.split("[")[0]
    cases = [known[other] for other in known if other.startswith(f"{family}[")] or [row]
    known[family] = min(cases, key=lambda case: case["ratio"])
    RATIOS.write_text(json.dumps(dict(sorted(known.items())), indent=2) + "\n")


def pytest_terminal_summary(terminalreporter) -> None:
    if not _ratios:
        return
    terminalreporter.section(f"ratios: medians of {PAIRS} interleaved pairs")
    for name, row in _ratios.items():
        terminalreporter.write_line(
            f"{name:40} {row['ratio']:7.2f} [{row['low']:.2f}, {row['high']:.2f}]"
            f"   target {row['target']:g}, {row['per_second']} a second"
        )
