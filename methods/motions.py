"""Whole motions for methods that know a motion's length from their demonstrations."""

import numpy as np

from tasks.data import FloatArray


def from_start(start: FloatArray, motion: FloatArray, steps: int) -> FloatArray:
    """Returns motions that begin at their starts and last ``steps`` more states.

    Args:
        start: x(1), (B, D).
        motion: (B, T, D), whose first states are replaced by the starts.
        steps: number of states after the start. A motion that is shorter holds its last state.

    Returns:
        (B, steps + 1, D).
    """
    kept = motion[:, np.minimum(np.arange(1, steps + 1), motion.shape[1] - 1)]
    return np.concatenate([start[:, None], kept], axis=1)
