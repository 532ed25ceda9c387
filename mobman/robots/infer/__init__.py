"""What a robot's TOML says, found out from its URDF: wheels, platform, arm, rest posture."""
