"""Experiment points, the region they are chosen from, and what the engine computes of them."""
