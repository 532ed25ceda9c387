"""What ``benchmarks/speed.py`` measures: one idea a file."""
