"""From a suite to its runs: names, what they stand for, and every combination of them."""
