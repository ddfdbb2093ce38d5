"""Reports are written in the process of a test, whose patches other processes would not have."""

import pytest


@pytest.fixture(autouse=True, scope="module")
def _one_process():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BENCH_JOBS", "1")
        yield
