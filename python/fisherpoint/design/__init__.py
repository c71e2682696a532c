"""The exchange algorithm, and the designs that it finds."""
