"""Table 2: success of NN by size of network, from the validation starts."""

from reports.sizes import size_exhibit

EXHIBIT = size_exhibit(2, "nn")
