"""Designs as weights of points, with the proof of how near to the optimum they are."""
