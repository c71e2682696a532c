"""What is known of the parameters before any experiment, and rules for expectations over it."""
