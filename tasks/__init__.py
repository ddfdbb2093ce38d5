"""Four Adroit-hand tasks in MuJoCo. This package knows nothing about methods."""

from tasks.pins import pin

pin()  # before NumPy and torch are loaded
