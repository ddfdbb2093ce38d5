"""The cache: files that can be made again, such as demonstrations and controllers."""

import os
from pathlib import Path

from tasks.errors import InputError
from tasks.files import writable_folder

_CURE = "set BENCH_CACHE to another folder"


def cache_folder() -> Path:
    """Returns the folder of the cache: BENCH_CACHE, or else kodex-bench in the XDG cache folder.

    Raises:
        InputError: BENCH_CACHE is not set, and the user has no home folder.
    """
    chosen = os.environ.get("BENCH_CACHE")
    if chosen:
        return Path(chosen)
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "kodex-bench"
    except RuntimeError as error:
        raise InputError(f"there is no home folder for the cache: {_CURE}") from error


def writable_cache(name: str) -> Path:
    """Returns a folder of the cache after checking that it can be written to. Creates nothing.

    Raises:
        InputError: it cannot be written to; or see `cache_folder`.
    """
    return writable_folder(cache_folder() / name, _CURE)
