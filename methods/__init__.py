"""Imitation policies. They see a task only as arrays."""
