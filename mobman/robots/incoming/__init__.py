"""What users name as a robot's description, and how it becomes a URDF on disk."""
