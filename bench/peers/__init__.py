"""Other programs on the same task: ``python -m bench peers``.

One file for each program, written the way a user who knows it would write it. `peer` has what they share, `registry` the list of
them, `compare` measures and `show` prints.
"""
