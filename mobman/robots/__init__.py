"""Robots as data: the TOML that describes one, the URDF it points at, and the catalogue of names."""
