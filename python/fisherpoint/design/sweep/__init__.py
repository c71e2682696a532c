"""Designs of several sizes."""
