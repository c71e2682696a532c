"""Criteria of optimality, designs as weights, and proofs of how near to the optimum a design is."""
