"""Closed loops: a sampled controller on a plant that may differ from what the controller knows."""
