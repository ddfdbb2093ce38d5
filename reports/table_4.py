"""Table 4: success of NDP by size of network, from the validation starts."""

from reports.sizes import size_exhibit

EXHIBIT = size_exhibit(4, "ndp")
