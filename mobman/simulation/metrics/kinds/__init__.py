"""The metrics; each module registers its own."""
