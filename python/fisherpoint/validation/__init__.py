"""Monte Carlo proof of what a design promises: virtual measurements, a fit of each, and what the fits have in common."""
