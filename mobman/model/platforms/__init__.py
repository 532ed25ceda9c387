"""Driving bases, one type a file; see :class:`mobman.model.platforms.platform.Platform`."""
