"""What the named trajectories are made of: families of smooth paths, and where a robot takes them."""
