"""Control laws: their interface, what they share, and a family of laws a file."""
