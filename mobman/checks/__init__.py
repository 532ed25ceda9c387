"""Whether a robot's description makes sense: checks of its numbers, its geometry and its equations."""
