"""Other projects' steps on the same robots, for the comparison of speed."""
