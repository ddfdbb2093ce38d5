"""Table 3: success of LSTM by size of network, from the validation starts."""

from reports.sizes import size_exhibit

EXHIBIT = size_exhibit(3, "lstm")
