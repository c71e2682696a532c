"""Candidates of designs as rows of sensitivities."""
