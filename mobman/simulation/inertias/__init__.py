"""In what the true links' masses and inertias differ; each module of kinds registers its own."""
