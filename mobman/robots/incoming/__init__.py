"""Ways in for a robot's description, which becomes a URDF on disk."""
