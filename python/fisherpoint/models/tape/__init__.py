"""Models as lists of operations: from SymPy expressions to the programs that the core interprets.

`from_sympy` reads expressions into a `Graph`, `differentiate` adds derivatives to it, `schedule` makes a `Program` of the requested
values, and `build_programs` does all of it for a model.
"""
