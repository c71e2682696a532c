"""The search for runs, and the designs that it finds."""
