"""Table 7: robustness to changed physics, tool use."""

from reports.robustness import robustness_exhibit

EXHIBIT = robustness_exhibit(7, "tool")
