"""Disturbance torques; each module registers the kinds it defines."""
