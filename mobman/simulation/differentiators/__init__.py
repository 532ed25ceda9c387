"""How z' is known; each module of kinds registers its own."""
