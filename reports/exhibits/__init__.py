"""Every table and figure of the report, found by its name.

An exhibit of the paper has the paper's number; one of this suite is named after what it shows.
Tables 1 to 5 are listed in `sizes`, Tables 7 to 10 in `robustness`; any other has its own file.
"""

from reports.exhibit import Exhibit
from reports.exhibits import (
    all_tasks,
    audit_physics,
    audit_rule,
    audit_variant,
    behind_expert,
    beyond,
    closed_loop,
    disturbed,
    efficiency,
    efficiency_time,
    expert_change,
    figure_5,
    figure_6,
    figure_6_time,
    figure_7,
    motions,
    rank,
    robustness,
    sizes,
    starts,
    success,
    success_over_time,
    table_6,
    table_11,
    table_12,
    times,
    two_experts,
)

EXHIBITS: tuple[Exhibit, ...] = (
    success.EXHIBIT,
    all_tasks.EXHIBIT,
    *sizes.EXHIBITS,
    table_6.EXHIBIT,
    figure_5.EXHIBIT,
    starts.EXHIBIT,
    success_over_time.EXHIBIT,
    motions.EXHIBIT,
    *robustness.EXHIBITS,
    disturbed.EXHIBIT,
    *beyond.EXHIBITS,
    behind_expert.EXHIBIT,
    closed_loop.EXHIBIT,
    *two_experts.EXHIBITS,
    *expert_change.EXHIBITS,
    table_11.EXHIBIT,
    figure_6.EXHIBIT,
    figure_6_time.EXHIBIT,
    figure_7.EXHIBIT,
    table_12.EXHIBIT,
    rank.EXHIBIT,
    efficiency.EXHIBIT,
    efficiency_time.EXHIBIT,
    times.EXHIBIT,
    audit_variant.EXHIBIT,
    audit_rule.EXHIBIT,
    audit_physics.EXHIBIT,
)
"""All exhibits, in the order of the page."""
