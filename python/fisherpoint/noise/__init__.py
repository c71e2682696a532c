"""Errors of sensors: what a user says of them, and the Fisher information about the noise-free outputs that readings have."""
