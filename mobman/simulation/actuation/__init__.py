"""What is between the commanded torque and the one that acts; each module of kinds registers its own."""
