"""Table 10: robustness to changed physics, in-hand reorientation."""

from reports.robustness import robustness_exhibit

EXHIBIT = robustness_exhibit(10, "reorientation")
