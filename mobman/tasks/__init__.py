"""Tasks: desired trajectories of the tip."""
