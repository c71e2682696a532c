"""The choice of pieces of a record."""
