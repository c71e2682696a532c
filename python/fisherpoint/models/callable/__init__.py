"""Models given by NumPy functions: the slow path for what cannot be written as equations."""
