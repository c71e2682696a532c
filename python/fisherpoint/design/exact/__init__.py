"""Designs as whole numbers of measurements of candidates, with the proof that there is none better."""
