"""From measured data to parameters: (5), (10), and what their a-posteriori information says."""
