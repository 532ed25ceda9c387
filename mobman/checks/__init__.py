"""Checks of a robot: its numbers, its geometry and its equations."""
