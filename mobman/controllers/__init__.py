"""Control laws: the protocol, the pieces they share, and one law a file in ``laws``."""
