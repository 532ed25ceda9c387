"""What is asked of a robot: trajectories of the tip, and criteria for its redundancy."""
