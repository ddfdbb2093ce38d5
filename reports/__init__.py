"""Stored results turned into tables and figures."""
