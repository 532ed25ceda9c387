"""Metrics of a run; each module registers its own."""
