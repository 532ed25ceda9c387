"""Inference of a robot's TOML from its URDF: wheels, platform, arm, rest posture."""
