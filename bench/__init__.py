"""The protocol: what is fitted, how it is evaluated, and where results are kept."""
