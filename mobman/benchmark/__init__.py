"""Suites of runs: described in TOML, run in parallel, kept in HDF5, reported."""
