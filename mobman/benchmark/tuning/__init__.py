"""Tuning of a suite's controllers with one budget for all of them."""
