"""The control laws; each module registers the ones it defines."""
