"""Trajectories with names; each module registers the ones it defines."""
