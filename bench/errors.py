"""What is said of an exception that is not the caller's fault."""


def described(error: Exception) -> str:
    """Returns one line that names an exception and gives its message."""
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__
