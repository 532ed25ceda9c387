"""The objectives; each module registers the one it defines."""
