"""The kinds; each module registers its own."""
