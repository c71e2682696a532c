"""Priors of the parameters, and rules for expectations over them."""
