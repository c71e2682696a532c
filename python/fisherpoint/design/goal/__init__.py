"""Goals of designs: criteria of optimality, and what candidates can determine."""
