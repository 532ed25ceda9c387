"""Criteria F(q) for the redundant degrees of freedom, one a file."""
