"""Stored results turned into tables and figures."""

from tasks.pins import pin

pin()  # before NumPy and torch are loaded
