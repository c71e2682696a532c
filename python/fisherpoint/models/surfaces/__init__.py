"""Where the equations of a model jump, have a corner or no value."""
