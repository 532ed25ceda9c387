"""Friction on the motors' axes; each module of kinds registers its own."""
