"""Charts as SVG: small, the same on every machine, and fit to stand in a page with others."""
