"""Charts of runs: described once, shown in a page, and written as SVG, PDF and PNG."""
