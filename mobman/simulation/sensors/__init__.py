"""What the sensors make of the state; each module of kinds registers its own."""
