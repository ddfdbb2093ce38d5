"""Table 8: robustness to changed physics, door opening."""

from reports.robustness import robustness_exhibit

EXHIBIT = robustness_exhibit(8, "door")
