"""The kinds of disturbances; each module registers its own."""
