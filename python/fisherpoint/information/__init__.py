"""The information of points: the design problem, the Fisher information that points add, and what can be identified from it."""
