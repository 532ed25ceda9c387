"""Doing runs: in this machine's processes, on a cluster, or wherever an executor leads."""
