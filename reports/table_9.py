"""Table 9: robustness to changed physics, object relocation."""

from reports.robustness import robustness_exhibit

EXHIBIT = robustness_exhibit(9, "relocation")
