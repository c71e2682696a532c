"""Which pictures of a fleet there are."""

PICTURES = ("plants.png", "standard_errors.png", "correlation.png")
"""What the command line draws."""
