"""The platform types; each module registers the ones it defines."""
