"""How the platform slips; each module of kinds registers its own."""
