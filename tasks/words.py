"""Words of messages that depend on a number."""


def count_of(count: int, noun: str, plural: str = "") -> str:
    """Returns a number with what it counts: ``1 fit``, ``2 fits``, ``1,000 tries``.

    Args:
        count: how many.
        noun: what one is called.
        plural: what several are called. Default: the noun with an s.
    """
    return f"{count:,} {noun if count == 1 else plural or f'{noun}s'}"
