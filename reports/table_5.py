"""Table 5: success of NGF by size of network, from the validation starts."""

from reports.sizes import size_exhibit

EXHIBIT = size_exhibit(5, "ngf")
