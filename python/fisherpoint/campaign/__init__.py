"""Experiments in batches: design, measure, estimate, until every parameter is known well enough."""
