"""Designs of a fleet: of several plants that share some parameters, and have values of their own of others."""
