"""Bridges to other tools: each is one file, and needs its library only where it is used."""
