"""The pieces of the two-stage terminal sliding mode laws."""
