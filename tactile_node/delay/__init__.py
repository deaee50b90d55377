"""How long messages were under way between two clocks that are not synchronised, and of how many sources they are."""
