"""The report of a benchmark: one self-contained HTML file, and Markdown with its figures."""
